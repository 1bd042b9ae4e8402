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
import java.net.MulticastSocket;
import java.util.ArrayList;
import java.util.List;
import java.util.Map;
import java.util.TreeMap;
import lcm.util.ClassDiscoverer;

/**
 * Starts lcm-spy once it is sure to decode everything: Launch --types NAME=FINGERPRINT... [--lcm URL].
 *
 * <p>The types named must be on the class path, found as lcm-spy itself will find them, with these fingerprints (hex).
 * Without --lcm that is all it looks at. Exit status 0, or 2 with one line on stderr that says why not.
 */
public final class Launch {
    /** At 1 kHz about a quarter of a second of messages, longer than a collection of garbage takes. */
    private static final int RECEIVE_BUFFER_BYTES = 2 << 20;
    private static final Dimension SPYS_CHANNEL_WINDOW = new Dimension(650, 400);
    private static final Dimension CHANNEL_WINDOW = new Dimension(840, 460); // columns are 200 wide from 800 on

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
        try {
            lcm.spy.Spy spy = new lcm.spy.Spy(url);
            leaveOutSelfTests(spy);
            watchEvents(spy);
            widen(spy);
        } catch (Exception failure) {
            fail(url + ": " + failure.getMessage());
        }
    }

    /** Whatever connects to the bus says a text of LCM's own there, which is no message and would be undecodable. */
    @SuppressWarnings("unchecked")
    private static void leaveOutSelfTests(lcm.spy.Spy spy) throws ReflectiveOperationException {
        Object lcm = value(spy, "lcm");
        synchronized (value(lcm, "subscriptions")) {
            ((Map<String, Object>) value(lcm, "subscriptionsMap")).put("LCM_SELF_TEST", new ArrayList<Object>());
        }
    }

    /**
     * A click that opens a channel's window shows the window's panel to the receiving thread before it has a window,
     * and lcm-spy then counts the messages of those milliseconds as undecodable. LCM hands out messages holding its
     * list of subscriptions; so do clicks now.
     *
     * <p>The window gets the width from which on lcm-spy has room between its columns for our longest names.
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

    /** LCM for Java leaves the receive buffer at the system's default, and has no option for it. */
    private static void widen(lcm.spy.Spy spy) {
        try {
            for (Object provider : (List<?>) value(value(spy, "lcm"), "providers")) {
                if (!(provider instanceof lcm.lcm.UDPMulticastProvider)) continue;
                MulticastSocket socket = (MulticastSocket) value(provider, "sock");
                socket.setReceiveBufferSize(RECEIVE_BUFFER_BYTES);
                int got = socket.getReceiveBufferSize();
                System.out.println("receive buffer " + got + " bytes");
                if (got < RECEIVE_BUFFER_BYTES) {
                    System.err.println("ballast spy: the system allows a receive buffer of " + got
                        + " bytes only, and messages may be missed; as root: sysctl -w net.core.rmem_max="
                        + RECEIVE_BUFFER_BYTES);
                }
            }
        } catch (Exception other) { // another LCM than 1.3 to 1.5: it works, with the system's default
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
