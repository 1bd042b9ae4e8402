"""Whether what a figure says can be read."""

from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.legend import Legend


def assert_words_apart(test, figure):
    """No title, label, legend entry, caption or number outside the page, and no two over each other.

    Numbers at the ends of two axes of one frame may come close to each other where the axes meet: one point is let
    pass. The numbers of axes in space stand slanted, which a box does not show; there only words count.
    """
    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # the page's layout happens here
    renderer = canvas.get_renderer()
    page = figure.bbox
    boxes = []
    texts = list(figure.texts)
    for axes in figure.axes:
        texts += [axes.title, axes._left_title, axes._right_title, *axes.texts]
        for legend in axes.findobj(Legend):
            texts += legend.get_texts()
        if axes.axison:
            for axis in axes.findobj(Axis):
                texts.append(axis.label)
                if axes.name != "3d":
                    low, high = sorted(axis.get_view_interval())
                    texts += [tick.label1 for tick in axis.get_major_ticks()
                              if tick.label1.get_visible() and low <= tick.get_loc() <= high]
    for text in texts:
        if text.get_visible() and text.get_text().strip():
            boxes.append((text.get_text(), text.get_window_extent(renderer)))
    point = figure.dpi / 72
    for i, (said, box) in enumerate(boxes):
        inside = box.x0 >= page.x0 and box.y0 >= page.y0 and box.x1 <= page.x1 and box.y1 <= page.y1
        test.assertTrue(inside, f"{said!r} leaves the page")
        for other, against in boxes[:i]:
            apart = (box.x0 > against.x1 - point or against.x0 > box.x1 - point or box.y0 > against.y1 - point or
                     against.y0 > box.y1 - point)
            test.assertTrue(apart, f"{said!r} covers {other!r}")
