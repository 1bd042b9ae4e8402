"""A path that grows without end, in a bounded number of points."""

import math


class ThinnedPath:
    """Points of a path, each with a tag. They lie at least `step_m` apart, which doubles whenever there are more than `most`."""

    def __init__(self, step_m, most):
        self._step_m, self._most = step_m, most
        self.points, self.tags = [], []
        self.newest = None  # (point, tag), whether it is one of `points` or not

    def add(self, point, tag):
        """Whether the point is kept."""
        self.newest = point, tag
        if self.points and tag == self.tags[-1] and math.dist(point, self.points[-1]) < self._step_m:
            return False
        self.points.append(point)
        self.tags.append(tag)
        if len(self.points) > self._most:
            self.points, self.tags = self.points[::2], self.tags[::2]
            self._step_m *= 2
        return True
