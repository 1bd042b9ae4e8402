package ballast.spy;

import java.awt.AWTEvent;
import java.awt.Dimension;
import java.awt.EventQueue;
import java.awt.GraphicsEnvironment;
import java.awt.Toolkit;
import java.awt.Window;
import java.awt.event.MouseEvent;
import java.awt.event.WindowEvent;
import java.lang.reflect.Field;
import java.lang.reflect.InvocationHandler;
import java.lang.reflect.Method;
import java.lang.reflect.Proxy;
import java.net.MulticastSocket;
import java.util.ArrayList;
import java.util.List;
import java.util.Map;
import java.util.TreeMap;
import javax.swing.table.AbstractTableModel;
import lcm.spy.ChannelData;
import lcm.util.ClassDiscoverer;

/**
 * Checks the message types and then starts lcm-spy: Launch --types NAME=FINGERPRINT... [--lcm URL].
 *
 * <p>The types must be on the class path, where lcm-spy finds them, with these fingerprints (hex). Without --lcm it only
 * checks. Exit status 0, or 2 with the reason in one line on stderr.
 */
public final class Launch {
    /** About a quarter of a second of messages at 1 kHz, longer than a garbage collection takes. */
    private static final int RECEIVE_BUFFER_BYTES = 2 << 20;
    private static final String SELF_TEST = "LCM_SELF_TEST";
    private static final Dimension SPYS_CHANNEL_WINDOW = new Dimension(650, 400);
    private static final Dimension CHANNEL_WINDOW = new Dimension(840, 460); // from 800 on, columns are 200 wide

    public static void main(String[] arguments) {
        String url = null;
        Map<String, Long> wanted = new TreeMap<String, Long>();
        for (int i = 0; i < arguments.length; ++i) {
            if (arguments[i].equals("--lcm") && i + 1 < arguments.length) {
                url = arguments[++i];
            } else if (arguments[i].contains("=")) {
                String[] pair = arguments[i].split("=", 2);
                wanted.put(pair[0], Long.parseUnsignedLong(pair[1], 16));
            }
        }
        String trouble = compare(wanted, found());
        if (trouble != null) fail(trouble);
        if (url != null) watch(url);
    }

    /** Every LCM type on the class path, by name, with its fingerprint. */
    private static Map<String, Long> found() {
        final Map<String, Long> types = new TreeMap<String, Long>();
        ClassDiscoverer.findClasses(System.getProperty("java.class.path"), new ClassDiscoverer.ClassVisitor() {
            public void classFound(String jar, Class type) {
                try {
                    types.put(type.getName(), type.getField("LCM_FINGERPRINT").getLong(null));
                } catch (ReflectiveOperationException | LinkageError notAType) {
                    return;
                }
            }
        });
        return types;
    }

    private static String compare(Map<String, Long> wanted, Map<String, Long> found) {
        if (found.isEmpty()) return "0 types found";
        for (Map.Entry<String, Long> type : wanted.entrySet()) {
            Long fingerprint = found.get(type.getKey());
            if (fingerprint == null) return type.getKey() + " is not among the " + found.size() + " types found";
            if (!fingerprint.equals(type.getValue())) {
                return type.getKey() + " is of another build (fingerprint " + Long.toHexString(fingerprint)
                    + ", the programs have " + Long.toHexString(type.getValue()) + ")";
            }
        }
        System.out.println(found.size() + " types");
        return null;
    }

    private static void watch(String url) {
        try {
            GraphicsEnvironment.getLocalGraphicsEnvironment().getDefaultScreenDevice();
        } catch (Throwable noWindows) { // AWTError, HeadlessException, a missing native library
            fail("no window can be opened: " + String.valueOf(noWindows.getMessage()).trim().replaceAll("\\s+", " ")
                + "\n  fix: set DISPLAY, or use ballast watch; a headless Java needs: apt-get install -y default-jre");
        }
        endOnCtrlC();
        try {
            lcm.spy.Spy spy = new lcm.spy.Spy(url);
            leaveOutSelfTests(spy);
            watchEvents(spy);
            widen(spy);
        } catch (Exception failure) {
            fail(url + ": " + failure.getMessage());
        }
    }

    /** Ctrl-C is the usual end. By itself Java ends with status 130. The class is not part of Java's own interface. */
    private static void endOnCtrlC() {
        InvocationHandler end = new InvocationHandler() {
            public Object invoke(Object proxy, Method method, Object[] arguments) {
                Runtime.getRuntime().halt(0);
                return null;
            }
        };
        try {
            Class<?> signal = Class.forName("sun.misc.Signal");
            Class<?> handler = Class.forName("sun.misc.SignalHandler");
            Object ends = Proxy.newProxyInstance(Launch.class.getClassLoader(), new Class<?>[] {handler}, end);
            Object ctrlC = signal.getConstructor(String.class).newInstance("INT");
            signal.getMethod("handle", signal, handler).invoke(null, ctrlC, ends);
        } catch (ReflectiveOperationException withoutSignals) {
            return;
        }
    }

    /**
     * LCM sends a text of its own whenever a program connects to the bus. lcm-spy cannot decode it, so it is ignored.
     *
     * <p>lcm-spy listens from its constructor on, so one may have come already; its row is taken out again.
     */
    @SuppressWarnings("unchecked")
    private static void leaveOutSelfTests(final lcm.spy.Spy spy) throws Exception {
        Object lcm = value(spy, "lcm");
        final Object messages = value(lcm, "subscriptions");
        synchronized (messages) {
            ((Map<String, Object>) value(lcm, "subscriptionsMap")).put(SELF_TEST, new ArrayList<Object>());
        }
        final List<ChannelData> rows = (List<ChannelData>) value(spy, "channelList");
        final Map<String, ChannelData> channels = (Map<String, ChannelData>) value(spy, "channelMap");
        final AbstractTableModel table = (AbstractTableModel) value(spy, "_channelTableModel");
        EventQueue.invokeAndWait(new Runnable() { // which draws the table
            public void run() {
                synchronized (messages) {
                    synchronized (rows) {
                        if (!rows.remove(channels.remove(SELF_TEST))) return;
                        for (int row = 0; row < rows.size(); ++row) rows.get(row).row = row;
                    }
                    table.fireTableDataChanged();
                }
            }
        });
    }

    /**
     * Fixes two details of lcm-spy. A click that opens a channel's window shows the window's panel to the receiving
     * thread before the window exists, and lcm-spy counts the messages of those milliseconds as undecodable. LCM locks
     * its list of subscriptions while it delivers messages, so clicks are handled under the same lock.
     *
     * <p>The window is made wide enough for the longest names of fields.
     */
    private static void watchEvents(lcm.spy.Spy spy) throws ReflectiveOperationException {
        final Object messages = value(value(spy, "lcm"), "subscriptions");
        Toolkit.getDefaultToolkit().getSystemEventQueue().push(new EventQueue() {
            @Override
            protected void dispatchEvent(AWTEvent event) {
                if (event.getID() == WindowEvent.WINDOW_OPENED) {
                    Window window = ((WindowEvent) event).getWindow();
                    if (window.getSize().equals(SPYS_CHANNEL_WINDOW)) window.setSize(CHANNEL_WINDOW);
                }
                if (!(event instanceof MouseEvent)) {
                    super.dispatchEvent(event);
                    return;
                }
                synchronized (messages) {
                    super.dispatchEvent(event);
                }
            }
        });
    }

    /** Enlarges the receive buffer. LCM for Java uses the system's default and has no option for it. */
    private static void widen(lcm.spy.Spy spy) {
        try {
            for (Object provider : (List<?>) value(value(spy, "lcm"), "providers")) {
                if (!(provider instanceof lcm.lcm.UDPMulticastProvider)) continue;
                MulticastSocket socket = (MulticastSocket) value(provider, "sock");
                socket.setReceiveBufferSize(RECEIVE_BUFFER_BYTES);
                int got = socket.getReceiveBufferSize();
                System.out.println("receive buffer " + got + " bytes");
                if (got < RECEIVE_BUFFER_BYTES) {
                    System.err.println("ballast spy: the system limits the receive buffer to " + got
                        + " bytes, so messages may be lost; as root: sysctl -w net.core.rmem_max="
                        + RECEIVE_BUFFER_BYTES);
                }
            }
        } catch (Exception other) { // an LCM other than 1.3 to 1.5 works, with the system's default
            System.err.println("ballast spy: the receive buffer stays at the system's default: " + other);
        }
    }

    private static Object value(Object object, String name) throws ReflectiveOperationException {
        Field field = object.getClass().getDeclaredField(name);
        field.setAccessible(true);
        return field.get(object);
    }

    private static void fail(String why) {
        System.err.println("ballast spy: " + why);
        System.exit(2);
    }
}
