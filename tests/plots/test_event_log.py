"""The log reader against messages packed by lcm-gen's own encoders."""

import random
import tempfile
import unittest
from pathlib import Path

import ballast
import numpy as np

from event_log import EventLog, LogError, layout_of
from synthetic_run import event

MESSAGE_CLASSES = (ballast.contact_t, ballast.plant_state_t, ballast.sensors_t, ballast.step_command_t,
                   ballast.controller_status_t, ballast.trip_t, ballast.operator_t,
                   ballast.scenario_piece_t)


def filled(value, draw):
    """A field of the same shape: every float a random float, every integer a random one that fits into 7 bits."""
    if isinstance(value, list):
        return [filled(entry, draw) for entry in value]
    return draw.uniform(-1e6, 1e6) if isinstance(value, float) else draw.randint(-128, 127)


class EventLogTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = Path(folder.name) / "run.lcmlog"

    def write(self, *events):
        self.path.write_bytes(b"".join(events))

    def contact(self, tick):
        message = ballast.contact_t()
        message.tick = tick
        return event(tick, tick, "BALLAST_CONTACT", message.encode())

    def read_contacts(self):
        log = EventLog(self.path, ["BALLAST_CONTACT"])
        return log, log.messages("BALLAST_CONTACT", ballast.contact_t)

    def test_every_field_of_every_type_comes_back(self):
        seed = random.randrange(2**32)
        draw = random.Random(seed)
        for message_class in MESSAGE_CLASSES:
            with self.subTest(message_class=message_class.__name__, seed=seed):
                sent = []
                for _ in range(3):
                    message = message_class()
                    for name in message_class.__slots__:
                        setattr(message, name, filled(getattr(message, name), draw))
                    sent.append(message)
                self.write(*(event(i, i, "CHANNEL", message.encode()) for i, message in enumerate(sent)))
                rows = EventLog(self.path, ["CHANNEL"]).messages("CHANNEL", message_class)
                self.assertEqual(len(rows), 3)
                for message, row in zip(sent, rows):
                    for name in message_class.__slots__:
                        np.testing.assert_array_equal(row[name], getattr(message, name), err_msg=f"{name}, seed {seed}")

    def test_wide_integers_keep_all_their_bits(self):
        message = ballast.step_command_t()
        message.tick, message.steps[7], message.burst_count = -2**63, 2**31 - 1, -2**15
        self.write(event(0, 0, "CHANNEL", message.encode()))
        row = EventLog(self.path, ["CHANNEL"]).messages("CHANNEL", ballast.step_command_t)[0]
        self.assertEqual((row["tick"], row["steps"][7], row["burst_count"]), (-2**63, 2**31 - 1, -2**15))

    def test_infinity_comes_back(self):
        message = ballast.contact_t()
        message.mu_required = float("inf")
        self.write(event(0, 0, "BALLAST_CONTACT", message.encode()))
        self.assertEqual(self.read_contacts()[1]["mu_required"][0], np.inf)

    def test_layout_has_the_size_of_the_message(self):
        for message_class in MESSAGE_CLASSES:
            self.assertEqual(layout_of(message_class).itemsize, len(message_class().encode()), message_class.__name__)

    def test_other_channels_are_passed_over_and_order_is_kept(self):
        self.write(self.contact(5), event(1, 1, "OTHER", b"anything"), self.contact(4))
        log, rows = self.read_contacts()
        self.assertEqual(list(rows["tick"]), [5, 4])
        self.assertIsNone(log.damage)

    def test_channel_without_messages_is_empty(self):
        self.write(event(0, 0, "OTHER", b""))
        self.assertEqual(len(self.read_contacts()[1]), 0)

    def test_cut_off_anywhere_keeps_the_whole_events(self):
        whole = self.contact(0) + self.contact(1)
        size = len(self.contact(0))
        for kept in range(size + 1, 2 * size):
            self.path.write_bytes(whole[:kept])
            log, rows = self.read_contacts()
            self.assertEqual(list(rows["tick"]), [0])
            self.assertIn(f"cut off inside an event at byte {size}", log.damage)

    def test_damage_in_the_middle_keeps_what_comes_before(self):
        self.write(self.contact(0), b"\0" * 40, self.contact(1))
        log, rows = self.read_contacts()
        self.assertEqual(list(rows["tick"]), [0])
        self.assertIn(f"damaged at byte {len(self.contact(0))}", log.damage)

    def test_wrong_fingerprint_is_refused(self):
        self.write(self.contact(0), event(1, 1, "BALLAST_CONTACT", b"\x01" * len(ballast.contact_t().encode())))
        with self.assertRaisesRegex(LogError, "BALLAST_CONTACT, message 1: not a contact_t .*0101010101010101"):
            self.read_contacts()

    def test_wrong_size_is_refused(self):
        self.write(event(0, 0, "BALLAST_CONTACT", ballast.contact_t().encode() + b"\0"))
        size = len(ballast.contact_t().encode())
        with self.assertRaisesRegex(LogError, f"{size + 1} bytes, expected {size}"):
            self.read_contacts()

    def test_missing_file_empty_file_and_another_format_are_refused(self):
        with self.assertRaisesRegex(LogError, "run.lcmlog: No such file"):
            EventLog(self.path, [])
        self.path.write_bytes(b"")
        with self.assertRaisesRegex(LogError, "the log is empty"):
            EventLog(self.path, [])
        self.path.write_bytes(b"t,theta_1,theta_2\n" * 10)
        with self.assertRaisesRegex(LogError, "not an LCM event log"):
            EventLog(self.path, [])


if __name__ == "__main__":
    unittest.main()
