"""tools/elf/stack on programs whose stack is known: written in assembly and counted by hand, or measured by the compiler
itself (-fstack-usage)."""
import os
import re
import unittest

from cross import Folder

HEADER = ".syntax unified\n.thumb\n.text\n"


def function(name, *lines):
    return f".global {name}\n.type {name}, %function\n.thumb_func\n{name}:\n" + "\n".join(lines) + f"\n.size {name}, .-{name}\n"


LEAF = function("leaf", "push {r4-r7, lr}", "pop {r4-r7, pc}")  # 20


class Stack(Folder):
    def assembled(self, *functions):
        return self.link({"program.s": HEADER + "".join(functions)}, "-nostdlib", "-Wl,--no-gc-sections,-e,0x101")

    def stack(self, elf, *arguments, entry="main"):
        return self.tool("stack", elf, "--main", entry, *arguments)

    def bytes_of(self, elf, *arguments, entry="main"):
        status, said, complaint = self.stack(elf, *arguments, entry=entry)
        self.assertEqual((status, complaint), (0, ""))
        return int(re.search(r"worst case: (\d+) bytes", said)[1])

    def refused(self, elf, *arguments):
        status, _, complaint = self.stack(elf, *arguments)
        self.assertEqual(status, 2, complaint)
        self.assertNotIn("Traceback", complaint)
        return complaint

    def test_every_way_to_take_stack(self):
        elf = self.assembled(function(
            "main",
            "push {r4, lr}",            # 8
            "vpush {d8-d9}",            # 24
            "vpush {s16-s18}",          # 36
            "sub sp, #12",              # 48
            "str r0, [sp, #-4]!",       # 52
            "strd r2, r3, [sp, #-8]!",  # 60
            "stmdb sp!, {r5, r6, r7}",  # 72
            "stmia sp, {r5, r6, r7}",   # into what is taken
            "movw r3, #5000",
            "sub sp, sp, r3",           # 5072
            "ldr r3, =70000",
            "sub sp, sp, r3",           # 75072
            "bl leaf",                  # 75092
            "ldr r3, =70000",
            "add sp, r3",
            "movw r3, #5000",
            "add sp, r3",
            "ldmia sp!, {r5, r6, r7}",
            "ldrd r2, r3, [sp], #8",
            "ldr r0, [sp], #4",
            "add sp, #12",
            "vpop {s16-s18}",
            "vpop {d8-d9}",
            "bl other",                 # 8 + 80000: had one of these not given its stack back, this would be more
            "pop {r4, pc}",
            ".ltorg"), LEAF, function("other", "ldr r3, =80000", "sub sp, sp, r3", "ldr r3, =80000", "add sp, r3",
                                      "bx lr", ".ltorg"))
        self.assertEqual(self.bytes_of(elf), 80008)

    def test_the_deepest_call_not_the_deepest_frame(self):
        elf = self.assembled(
            function("main", "push {lr}", "bl shallow", "sub sp, #8", "bl deep", "add sp, #8", "pop {pc}"),
            function("shallow", "sub sp, #100", "add sp, #100", "bx lr"),
            function("deep", "sub sp, #40", "push {lr}", "bl leaf", "pop {lr}", "add sp, #40", "bx lr"), LEAF)
        status, said, _ = self.stack(elf)
        self.assertEqual(status, 0)
        self.assertIn("worst case: 104 bytes", said)  # 4 + 100
        elf = self.assembled(
            function("main", "push {lr}", "bl shallow", "sub sp, #8", "bl deep", "add sp, #8", "pop {pc}"),
            function("shallow", "sub sp, #64", "add sp, #64", "bx lr"),
            function("deep", "sub sp, #40", "push {lr}", "bl leaf", "pop {lr}", "add sp, #40", "bx lr"), LEAF)
        status, said, _ = self.stack(elf)
        self.assertIn("worst case: 76 bytes", said)  # 12 + 44 + 20
        self.assertEqual([line.split() for line in said.splitlines()[1:4]],
                         [["12", "main"], ["44", "deep"], ["20", "leaf"]])

    def test_branches_are_alternatives_and_tail_calls_give_back_first(self):
        elf = self.assembled(
            function("main", "cbz r0, 1f", "push {r4-r7, lr}", "sub sp, #44", "add sp, #44", "pop {r4-r7, lr}", "b leaf",
                     "1: sub sp, #32", "cmp r1, #0", "it eq", "addeq r2, #1", "add sp, #32", "bx lr"), LEAF)
        self.assertEqual(self.bytes_of(elf), 64)  # not 64 + 32, not 64 + 20

    def test_one_function_running_into_the_next(self):
        elf = self.assembled(function("main", "sub sp, #16"), function("second", "push {r0-r3}", "add sp, #32", "bx lr"))
        status, _, complaint = self.stack(elf)
        self.assertEqual(status, 2)  # `second` gives back what it has not taken
        self.assertIn("takes more from the stack", complaint)
        elf = self.assembled(function("main", "mov r0, r1"), LEAF)
        self.assertEqual(self.bytes_of(elf), 20)

    def test_a_jump_table(self):
        cases = "".join(f"case {k}: asm volatile(\"nop @ %0\" :: \"r\"({k})); use({1 << k}); break;" for k in range(8))
        elf = self.link({"program.cpp": f'''
            extern "C" {{
            [[gnu::noinline]] void use(int n) {{ volatile char a[64]; a[n % 64] = 1; }}
            [[gnu::noinline]] void far(int n) {{ volatile char a[512]; a[n] = 1; }}
            volatile int which;
            int main() {{ switch (which) {{ {cases} case 8: far(3); break; }} }}
            }}'''})
        self.assertGreaterEqual(self.bytes_of(elf), 512)

    def test_recursion_is_refused_and_named(self):
        elf = self.assembled(function("main", "push {lr}", "bl even", "pop {pc}"),
                             function("even", "push {lr}", "bl odd", "pop {pc}"),
                             function("odd", "push {lr}", "bl even", "pop {pc}"))
        self.assertIn("recursion: even -> odd -> even", self.refused(elf))
        elf = self.assembled(function("main", "push {lr}", "bl main", "pop {pc}"))
        self.assertIn("recursion: main -> main", self.refused(elf))

    def test_calls_through_registers_have_to_be_declared(self):
        elf = self.assembled(function("main", "push {lr}", "blx r3", "pop {pc}"), LEAF, function("tail", "bx r2"))
        self.assertRegex(self.refused(elf), "main: 0x[0-9a-f]+: blx r3: a call through a register")
        self.assertEqual(self.bytes_of(elf, "--calls", "main=leaf"), 24)
        self.assertEqual(self.bytes_of(elf, "--calls", "main="), 4)
        self.assertEqual(self.bytes_of(elf, "--calls", "main=le*,absent*"), 24)
        self.assertIn("no function absent", self.refused(elf, "--calls", "main=absent"))
        self.assertIn("no call through a register was met", self.refused(elf, "--calls", "main=leaf", "--calls", "leaf=main"))
        self.assertEqual(self.bytes_of(elf, "--calls", "tail=leaf", entry="tail"), 20)

    def test_what_is_known_only_at_run_time_is_refused(self):
        elf = self.assembled(function("main", "sub sp, sp, r0", "add sp, sp, r0", "bx lr"))
        self.assertIn("known only at run time", self.refused(elf))
        elf = self.assembled(function("main", "mov sp, r0", "bx lr"))
        self.assertIn("not known", self.refused(elf))
        elf = self.assembled(function("main", "1: push {r0}", "b 1b"))
        self.assertIn("grows in a loop", self.refused(elf))
        elf = self.assembled(function("main", "ldr pc, [r0, r1, lsl #2]"))
        self.assertIn("where this leads is not known", self.refused(elf))

    def test_interrupts_add_up_over_levels(self):
        handlers = [function(name, f"sub sp, #{size}", f"add sp, #{size}", "bx lr")
                    for name, size in (("tick", 200), ("uart", 100), ("step", 40))]
        elf = self.assembled(function("main", "sub sp, #16", "add sp, #16", "bx lr"), *handlers)
        arguments = ["--interrupt", "3:tick", "--interrupt", "3:uart", "--interrupt", "1:step"]
        self.assertEqual(self.bytes_of(elf, *arguments), 16 + (108 + 200) + (108 + 40))
        self.assertEqual(self.bytes_of(elf, *arguments, "--no-fpu"), 16 + (36 + 200) + (36 + 40))

    def test_budget(self):
        elf = self.assembled(LEAF)
        self.assertEqual(self.stack(elf, "--budget", "20", entry="leaf")[0], 0)
        status, said, complaint = self.stack(elf, "--budget", "19", entry="leaf")
        self.assertEqual(status, 1)
        self.assertIn("worst case: 20 bytes of 19", said)
        self.assertIn("1 more than the 19", complaint)

    def test_agrees_with_the_compiler(self):
        """-fstack-usage knows GCC's own functions; a chain of them adds up."""
        for flags in (["-O0"], ["-O1"], ["-O2"], ["-O3"], ["-Os"], ["-O1", "-fno-omit-frame-pointer"]):
            with self.subTest(flags=flags):
                elf = self.link({"program.cpp": '''
                    volatile double sink;
                    extern "C" {
                    [[gnu::noinline, gnu::noipa]] double third(const double* p) {
                      volatile double a[700]; a[3] = p[0]; return a[3] + p[1]; }
                    [[gnu::noinline, gnu::noipa]] double second(double x, double y) {
                      double a[20]; for (int i = 0; i < 20; ++i) a[i] = x * i + y;
                      const double z = third(a); return z * x + third(a + 2) * y; }
                    int main() { sink = second(sink, sink) + 1; return static_cast<int>(sink); }
                    }'''}, *flags, "-fstack-usage")
                usage = {}
                for file in os.listdir(self.folder):
                    if file.endswith(".su"):
                        with open(os.path.join(self.folder, file), encoding="utf-8") as text:
                            usage.update(re.findall(r":[^:\t]*?(\w+)(?:\([^\t]*\))?\t(\d+)\t", text.read()))
                self.assertEqual(set(usage), {"main", "second", "third"})
                self.assertEqual(self.bytes_of(elf), sum(map(int, usage.values())))

    def test_libm_is_counted(self):
        elf = self.link({"program.cpp": '#include <cmath>\nvolatile double x;\nint main() { x = std::sin(x); }'})
        status, said, _ = self.stack(elf)
        self.assertEqual(status, 0)
        self.assertRegex(said, r"\d{3}  __kernel_rem_pio2")

    def test_nonsense(self):
        self.assertIn("No such file", self.refused(os.path.join(self.folder, "absent.elf")))
        text = os.path.join(self.folder, "text")
        with open(text, "w", encoding="utf-8") as out:
            out.write("not a program")
        self.assertNotEqual(self.refused(text), "")
        elf = self.assembled(LEAF)
        self.assertIn("no function main", self.refused(elf))
        self.assertIn("LEVEL:NAME", self.tool("stack", elf, "--main", "leaf", "--interrupt", "tick")[2])
        self.assertIn("CALLER=CALLEE", self.tool("stack", elf, "--main", "leaf", "--calls", "leaf")[2])


if __name__ == "__main__":
    unittest.main()
