import java.awt.Component;
import java.awt.Container;
import java.awt.Frame;
import java.awt.Point;
import java.awt.Rectangle;
import java.awt.Toolkit;
import java.awt.event.InputEvent;
import java.awt.event.MouseEvent;
import javax.swing.JTable;
import javax.swing.SwingUtilities;

/**
 * A Java agent inside lcm-spy: once a run is under way it opens every channel's window as a double-click does, waits,
 * prints the table row by row, cells separated by |, then titles and widths of the windows, and ends the program.
 */
public final class Probe {
    public static void premain(String arguments) {
        Thread thread = new Thread(() -> {
            try {
                look(Integer.parseInt(arguments));
            } catch (Throwable trouble) {
                trouble.printStackTrace();
                Runtime.getRuntime().halt(1);
            }
        });
        thread.setDaemon(true);
        thread.start();
    }

    private static void look(int messages) throws Exception {
        JTable table = null;
        while (table == null || !heard(table, messages)) {
            Thread.sleep(100);
            for (Frame frame : Frame.getFrames()) {
                JTable found = "LCM Spy".equals(frame.getTitle()) ? find(frame) : null;
                if (found != null) table = found;
            }
        }
        for (int row = 0; row < table.getRowCount(); ++row) click(table, row);
        while (!heard(table, 2 * messages)) Thread.sleep(100);
        final JTable shown = table;
        SwingUtilities.invokeAndWait(() -> {
            for (int row = 0; row < shown.getRowCount(); ++row) {
                StringBuilder line = new StringBuilder("ROW");
                for (int column = 0; column < shown.getColumnCount(); ++column) {
                    line.append("|").append(String.valueOf(shown.getValueAt(row, column)).trim());
                }
                System.out.println(line);
            }
            for (Frame frame : Frame.getFrames()) {
                if (frame.isVisible()) System.out.println("WINDOW|" + frame.getTitle() + "|" + frame.getWidth());
            }
        });
        System.out.flush();
        Runtime.getRuntime().halt(0);
    }

    private static boolean heard(JTable table, int messages) {
        for (int row = 0; row < table.getRowCount(); ++row) {
            if (table.getValueAt(row, 0).equals("BALLAST_TRIP")) {
                return Integer.parseInt(String.valueOf(table.getValueAt(row, 2))) >= messages;
            }
        }
        return false;
    }

    private static JTable find(Container container) {
        for (Component component : container.getComponents()) {
            if (component instanceof JTable) return (JTable) component;
            JTable inside = component instanceof Container ? find((Container) component) : null;
            if (inside != null) return inside;
        }
        return null;
    }

    private static void click(JTable table, int row) {
        Rectangle cell = table.getCellRect(row, 0, true);
        Point at = new Point(cell.x + cell.width / 2, cell.y + cell.height / 2);
        for (int id : new int[] {MouseEvent.MOUSE_PRESSED, MouseEvent.MOUSE_RELEASED, MouseEvent.MOUSE_CLICKED}) {
            Toolkit.getDefaultToolkit().getSystemEventQueue().postEvent(new MouseEvent(table, id,
                System.currentTimeMillis(), InputEvent.BUTTON1_DOWN_MASK, at.x, at.y, 2, false, MouseEvent.BUTTON1));
        }
    }
}
