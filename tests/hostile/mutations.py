"""Ways to damage bytes and texts: small, seeded, and blind to what the file is."""

import re
import struct
from collections.abc import Callable, Sequence
from random import Random

Files = dict[str, bytes]
"""The files of one input, by their path in its folder."""
Mutation = Callable[[Random, Files], Files]
Damage = Callable[[Random, bytes], bytes]

SIZES = (0, 1, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**63, 2**64 - 1, 6_000_000_000)
REALS = (float("nan"), float("inf"), float("-inf"), 1e308, -1e30, 1e4, 1e-320, -0.0)
WORDS = (
    "", "0", "-1", "1e-9", "1e308", "1e999", ".nan", ".inf", "nan", "9" * 5000, "-" * 50, "2021-02-31",
    "2021-99-99 25:61:61", "!!timestamp 99", "!!python/object/apply:os.getcwd []", "!!binary x", "&a [*a]", "*nothing",
    "{a: *b}", "<<: *x", "null", "~", "true", "[]", "{}", "[" * 300 + "]" * 300, "{a: " * 200 + "}" * 200, "'",
    '"\\ud800"', '"\\x00"', "\x00", "\ufeff", "é" * 300, "a" * 300, "../" * 40 + "etc/passwd", "/dev/zero",
    "/proc/self/mem", "~nobody/x", "**/" * 60 + "*", "[[[[", "(a+)+$", "(?P<n>", "\\", "${oc.env:HOME}", "${a.b.c}",
    "${", "???", "0x" + "f" * 400, "1_000_000_000_000_000_000_000", "0" * 400, "1:2:3:4:5:6:7:8", ",", ";", "\t",
    "\r\n", "---\n", "...\n", "%TAG ! x\n", "# ", ": ", "- ", "? ",
)  # fmt: skip
ALIASES = "l0: &l0 [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"l{n}: &l{n} [{', '.join([f'*l{n - 1}'] * 9)}]\n" for n in range(1, 10)
)
_TOKEN = re.compile(r"[^\s,:;\[\]{}=]+")


def flip(random: Random, data: bytes) -> bytes:
    """One bit."""
    changed = bytearray(data or b"\0")
    changed[random.randrange(len(changed))] ^= 1 << random.randrange(8)
    return bytes(changed)


def overwrite(random: Random, data: bytes) -> bytes:
    """A number where some bytes were."""
    form = random.choice(("<B", "<H", "<I", "<Q", ">I", ">Q", "<d", "<f"))
    if form[1] in "df":
        number = random.choice(REALS)
        number = min(max(number, -3e38), 3e38) if form[1] == "f" and number == number else number
    else:
        number = random.choice(SIZES) & (2 ** (8 * struct.calcsize(form)) - 1)
    packed = struct.pack(form, number)
    at = random.randrange(len(data) + 1)
    return data[:at] + packed + data[at + len(packed) :]


def cut(random: Random, data: bytes) -> bytes:
    """The end away."""
    return data[: random.randrange(len(data) + 1)]


def remove(random: Random, data: bytes) -> bytes:
    """A piece out of the middle."""
    start, end = _piece(random, data)
    return data[:start] + data[end:]


def repeat(random: Random, data: bytes) -> bytes:
    """A piece twice."""
    start, end = _piece(random, data)
    return data[:end] + data[start:end] + data[end:]


def swap(random: Random, data: bytes) -> bytes:
    """Two pieces in each other's place."""
    a, b, c, d = sorted(random.randrange(len(data) + 1) for _ in range(4))
    return data[:a] + data[c:d] + data[b:c] + data[a:b] + data[d:]


def scramble(random: Random, data: bytes) -> bytes:
    """A short piece of other bytes."""
    start, end = _piece(random, data, 64)
    return data[:start] + random.randbytes(end - start) + data[end:]


def word(random: Random, data: bytes) -> bytes:
    """A hostile word in place of one of a text, or after it."""
    text = data.decode("utf-8", "surrogateescape")
    places = [found.span() for found in _TOKEN.finditer(text)] or [(0, 0)]
    start, end = random.choice(places)
    if random.random() < 0.2:
        start = end
    return (text[:start] + random.choice(WORDS) + text[end:]).encode("utf-8", "surrogateescape")


def line(random: Random, data: bytes) -> bytes:
    """A line left out, repeated, indented, joined to the next, or put elsewhere."""
    lines = data.split(b"\n")
    at, to = random.randrange(len(lines)), random.randrange(len(lines))
    taken = lines[at]
    kind = random.randrange(5)
    if kind == 0:
        del lines[at]
    elif kind == 1:
        lines.insert(to, taken)
    elif kind == 2:
        lines[at] = b" " * random.randrange(1, 5) + taken
    elif kind == 3:
        lines[at : at + 2] = [b" ".join(lines[at : at + 2])]
    else:
        lines[at], lines[to] = lines[to], taken
    return b"\n".join(lines)


def aliases(random: Random, data: bytes) -> bytes:
    """A few hundred bytes of YAML that unfold to a billion items."""
    return ALIASES.encode() + data if random.random() < 0.5 else data + b"\n" + ALIASES.encode()


BINARY: Sequence[Damage] = (flip, flip, overwrite, overwrite, cut, remove, repeat, swap, scramble)
TEXT: Sequence[Damage] = (word, word, word, word, line, line, flip, remove, repeat, cut, aliases)


def on(damages: Sequence[Damage], *suffixes: str) -> Mutation:
    """A mutation that damages one of the files with these suffixes (none: any) in one of these ways."""

    def mutate(random: Random, files: Files) -> Files:
        names = sorted(name for name in files if not suffixes or name.endswith(suffixes))
        name = random.choice(names)
        return files | {name: random.choice(damages)(random, files[name])}

    return mutate


def _piece(random: Random, data: bytes, longest: int = 4096) -> tuple[int, int]:
    start = random.randrange(len(data) + 1)
    return start, min(len(data), start + random.randrange(1, longest + 1))
