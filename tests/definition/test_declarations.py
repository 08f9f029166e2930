"""Every construct of the language: a line of text, and the type it stands for."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.definition.model import UnknownName
from nvscope.definition.scalars import SCALARS
from nvscope.definition.variables import Scalar, ScalarKind, elements, size_bytes_of
from tests.definition.declared import declared, problem, shown, types_of

PRELUDE = """
TYPE Axis : STRUCT pos : LREAL; vel, acc : REAL; END_STRUCT END_TYPE
TYPE Slow EXTENDS Axis : STRUCT limit : INT; END_STRUCT END_TYPE
TYPE Later : STRUCT EXTENDS Slow flag : BOOL; END_STRUCT END_TYPE
TYPE Colour : (red, green := 5, blue); END_TYPE
TYPE Level : (low := 1, high := low + 1) USINT := low; END_TYPE
TYPE Speed : UINT (0..3_000) := 5; Speeds : ARRAY [0..1] OF Speed; END_TYPE
TYPE Both : UNION word : WORD; bytes : ARRAY [0..1] OF BYTE; END_UNION END_TYPE
TYPE Handle : UNION address : POINTER TO INT; END_UNION END_TYPE
TYPE Outer : STRUCT inner : STRUCT a : INT; END_STRUCT; b : BIT; END_STRUCT END_TYPE
FUNCTION_BLOCK Motor VAR_INPUT run : BOOL; END_VAR run := NOT run; END_FUNCTION_BLOCK
VAR_GLOBAL CONSTANT
    N : INT := 4; M : UINT := (N + 2) * 3 MOD 5 - 16#F / 4; MASK : WORD := 2#1010; TYPED : INT := INT#7;
    name : STRING := 'x'; rate : REAL := 0.5;
END_VAR
"""

AXIS = "pos: LREAL; vel: REAL; acc: REAL;"
TYPES = {
    "BOOL": "BOOL",
    "bool := TRUE": "BOOL",
    "Time_Of_Day": "TOD",
    "DATE_AND_TIME := DT#2024-05-02-10:00:00": "DT",
    "LTIME := LTIME#1s5ms": "LTIME",
    "TIME := T#1h2m3s": "TIME",
    "STRING": "STRING(80)",
    "STRING(N * 10)": "STRING(40)",
    "STRING[12] := 'it$'s; (* no comment'": "STRING(12)",
    'WSTRING(5) := "a;b"': "WSTRING(5)",
    "Axis": f"STRUCTURE {AXIS}",
    "AXIS := (pos := 1.0, vel := -2.5E3)": f"STRUCTURE {AXIS}",
    "Slow": f"STRUCTURE {AXIS} limit: INT;",
    "Later": f"STRUCTURE {AXIS} limit: INT; flag: BOOL;",
    "Project.Axis": f"STRUCTURE {AXIS}",
    "Outer": "STRUCTURE inner: STRUCTURE a: INT;; b: BIT;",
    "Colour := Colour.green": "(red=0, green=5, blue=6) INT",
    "Colour := Colour#green": "(red=0, green=5, blue=6) INT",
    "Level": "(low=1, high=2) USINT",
    "(one := 1, two,) DINT": "(one=1, two=2) DINT",
    "Speeds": "ARRAY[0..1] OF UINT(0..3000)",
    "INT (-5..N)": "INT(-5..4)",
    "Both": "UNION word: WORD; bytes: ARRAY[0..1] OF BYTE;",
    "ARRAY [0 .. 4, 1..2] OF INT": "ARRAY[0..4, 1..2] OF INT",
    "ARRAY [-1..+1] OF ARRAY [0..0] OF Axis": f"ARRAY[-1..1] OF ARRAY[0..0] OF STRUCTURE {AXIS}",
    "ARRAY [0..N-1] OF BYTE := [1, 2, 2(0)]": "ARRAY[0..3] OF BYTE",
    "ARRAY [0..3] OF BYTE := 1, 2, 2(0)": "ARRAY[0..3] OF BYTE",
    "ARRAY [0..1] OF Axis := [(pos := 1), 1((pos := 2, vel := 3))]": f"ARRAY[0..1] OF STRUCTURE {AXIS}",
    "ARRAY [0..M] OF BOOL": "ARRAY[0..0] OF BOOL",
    "ARRAY [1..MASK] OF BOOL": "ARRAY[1..10] OF BOOL",
    "ARRAY [1..TYPED] OF BOOL": "ARRAY[1..7] OF BOOL",
    "ARRAY [0..INT_TO_DINT(N) - 1] OF BOOL": "ARRAY[0..3] OF BOOL",
    "ARRAY [-1..to_usint(N + int_to_word(M))] OF BOOL": "ARRAY[-1..4] OF BOOL",
    "DWORD := REAL_TO_DWORD(rate) + SIZEOF(x)": "DWORD",
    "ARRAY [1..8#17] OF BOOL": "ARRAY[1..15] OF BOOL",
    "ARRAY [1..list.n] OF BOOL": "ARRAY[1..4] OF BOOL",
    "ARRAY [red..Colour.blue] OF BOOL": "ARRAY[0..6] OF BOOL",
    "ARRAY [-7/2..-(-7 MOD 4)] OF BOOL": "ARRAY[-3..3] OF BOOL",
    "POINTER TO ARRAY [0..9] OF INT := ADR(x[1])": "POINTER",
    "REFERENCE TO Axis REF= other": "REFERENCE",
    "Motor := (run := TRUE)": "Motor",
    "TON := (PT := T#5s)": "TON",
    "Motor(1, x := 2)": "Motor",
    "Library.FILE": "Library.FILE",
    "DWORD := SHL(1, 3) OR 16#FF AND NOT (a <> b)": "DWORD",
    "INT := ptr^.member[3].x": "INT",
    "REAL := 1. + 2": "REAL",
    "Axis := ()": f"STRUCTURE {AXIS}",
    "ARRAY [0..1] OF Axis := [(), (pos := 1)]": f"ARRAY[0..1] OF STRUCTURE {AXIS}",
    "ARRAY [0..1] OF Motor[(1, x := 2), (3, x := 4)]": "ARRAY[0..1] OF Motor",
    "Motor[(run := TRUE)]": "Motor",
    "Trace<10>": "Trace<…>",
    "ARRAY [0..1] OF Lib.Ring<N + 1, 2>": "ARRAY[0..1] OF Lib.Ring<…>",
    "BOOL := TRUE AND_THEN FALSE OR_ELSE TRUE": "BOOL",
    "STRING := UTF8#'gr$'ün'": "STRING(80)",
    'WSTRING := WSTRING#"a;b"': "WSTRING(80)",
    "ARRAY [1..SIZEOF(DINT) + SIZEOF(LREAL)] OF BYTE": "ARRAY[1..12] OF BYTE",
    "ARRAY [1..SIZEOF(Speeds)] OF BYTE": "ARRAY[1..4] OF BYTE",
    "STRING(EXPT(2, N) - 1)": "STRING(15)",
    "ARRAY [1..SHL(1, N)] OF BYTE": "ARRAY[1..16] OF BYTE",
    "ARRAY [1..shr(16#FF, 4)] OF BYTE": "ARRAY[1..15] OF BYTE",
    "ARRAY [1..MAX(N, 2, TYPED)] OF BYTE": "ARRAY[1..7] OF BYTE",
    "ARRAY [1..MIN(N, TYPED)] OF BYTE": "ARRAY[1..4] OF BYTE",
    "ARRAY [1..LIMIT(1, 99, N)] OF BYTE": "ARRAY[1..4] OF BYTE",
    "ARRAY [1..ABS(-N)] OF BYTE": "ARRAY[1..4] OF BYTE",
    "ARRAY [1..SEL(TRUE, 1, N)] OF BYTE": "ARRAY[1..4] OF BYTE",
    "ARRAY [1..SIZEOF(STRING(10))] OF BYTE": "ARRAY[1..11] OF BYTE",
    "ARRAY [1..SIZEOF(STRING)] OF BYTE": "ARRAY[1..81] OF BYTE",
    "ARRAY [1..sizeof(WSTRING[N])] OF BYTE": "ARRAY[1..10] OF BYTE",
    "ARRAY [1..XSIZEOF(DINT)] OF BYTE": "ARRAY[1..4] OF BYTE",
    "ARRAY [1..SIZEOF(ARRAY [1..N] OF INT)] OF BYTE": "ARRAY[1..8] OF BYTE",
    "ARRAY [1..16#F AND 3] OF BYTE": "ARRAY[1..3] OF BYTE",
    "ARRAY [1..16#F & 3] OF BYTE": "ARRAY[1..3] OF BYTE",
    "ARRAY [1..16#10 OR 3 XOR 1] OF BYTE": "ARRAY[1..18] OF BYTE",
    "ARRAY [1..ROL(1, 3)] OF BYTE": "ARRAY[1..8] OF BYTE",
    "ARRAY [1..ROR(16#30, 4)] OF BYTE": "ARRAY[1..3] OF BYTE",
    "ARRAY [1..MUX(1, 5, N, 7)] OF BYTE": "ARRAY[1..4] OF BYTE",
    "ARRAY [1..MUX(9, 5, N, 7)] OF BYTE": "ARRAY[1..7] OF BYTE",
    "ARRAY [1..TRUNC(3.7)] OF BYTE": "ARRAY[1..3] OF BYTE",
    "ARRAY [TRUNC(-1.4)..TRUNC_INT(REAL#1.9)] OF BYTE": "ARRAY[-1..1] OF BYTE",
    "ARRAY [1..REAL_TO_INT(2.0)] OF BYTE": "ARRAY[1..2] OF BYTE",
    "ARRAY [REAL_TO_INT(-1.5)..TO_INT(2.5)] OF BYTE": "ARRAY[-2..2] OF BYTE",
    "ARRAY [1..LREAL_TO_UINT(7 / 2.0)] OF BYTE": "ARRAY[1..4] OF BYTE",
    "ARRAY [1..REAL_TO_INT(3)] OF BYTE": "ARRAY[1..3] OF BYTE",
    "ARRAY [1..REAL_TO_INT(INT_TO_REAL(N) / 3)] OF BYTE": "ARRAY[1..1] OF BYTE",
    "ARRAY [0..BOOL_TO_INT(TRUE)] OF BYTE": "ARRAY[0..1] OF BYTE",
    "ARRAY [0..BOOL_TO_INT(NOT TRUE)] OF BYTE": "ARRAY[0..0] OF BYTE",
    "ARRAY [1..SEL(1 = 1, 3, N)] OF BYTE": "ARRAY[1..4] OF BYTE",
    "ARRAY [1..SEL(N <= 3, 3, N)] OF BYTE": "ARRAY[1..3] OF BYTE",
    "ARRAY [1..SEL(N <> 4 OR_ELSE N > 5.5, 3, N)] OF BYTE": "ARRAY[1..3] OF BYTE",
    "ARRAY [1..SEL(NOT (N < 2) AND_THEN N >= 4, 3, N)] OF BYTE": "ARRAY[1..4] OF BYTE",
}


@pytest.mark.parametrize("text", TYPES)
def test_type(text: str, tmp_path: Path) -> None:
    definition = declared(f"{PRELUDE} VAR_GLOBAL x : {text}; END_VAR", tmp_path)
    (variable,) = definition.lists[0].variables
    assert shown(variable.type) == TYPES[text]


def test_variables_and_everything_around_them(tmp_path: Path) -> None:
    definition = declared(
        """{attribute 'qualified_only'} (* a list (* of *) variables *)
        var_Global Persistent RETAIN // several
            a, b : REAL; c AT %MB0 : INT := 5;;
            {attribute 'unit' := 'm/s'} {attribute 'hidden'}
            speed /* inside */ : (* here { *) REAL; { region "x" }
            d AT %I*, e AT %IR3.0, g AT %QR4.0 : BOOL;
        END_VAR
        VAR_GLOBAL END_VAR
        Var_Global f : TIME; END_VAR;""",
        tmp_path,
    )
    (found,) = definition.lists
    assert found.name == "List"
    assert (found.list_id, found.interval_ns) == (None, None)
    assert [(variable.name, shown(variable.type)) for variable in found.variables] == [
        ("a", "REAL"), ("b", "REAL"), ("c", "INT"), ("speed", "REAL"), ("d", "BOOL"), ("e", "BOOL"), ("g", "BOOL"),
        ("f", "TIME"),
    ]  # fmt: skip
    assert [dict(variable.attributes) for variable in found.variables if variable.attributes] == [
        {"unit": "m/s", "hidden": ""}
    ]
    assert (found.variables[3].position.line, found.variables[3].position.column) == (5, 13)


def test_a_text_with_types_only_is_no_list(tmp_path: Path) -> None:
    assert declared(PRELUDE, tmp_path).lists == ()


def test_elements_in_the_order_in_which_they_are_sent(tmp_path: Path) -> None:
    text = f"{PRELUDE} VAR_GLOBAL x : ARRAY [0..1, 1..2] OF Axis; END_VAR"
    (variable,) = declared(text, tmp_path).lists[0].variables
    names = [element.name for element in elements(variable)]
    assert names[:4] == ["x[0, 1].pos", "x[0, 1].vel", "x[0, 1].acc", "x[0, 2].pos"]
    assert len(names) == 12
    assert size_bytes_of(variable.type) == 64


def test_types_of_unknown_size_say_so(tmp_path: Path) -> None:
    (tmp_path / "List.st").write_text(PRELUDE)
    types = {name.upper(): kind for name, kind in types_of([str(tmp_path / "List.st")], tmp_path).items()}
    sizes = {name: size_bytes_of(kind) for name, kind in types.items()}
    assert sizes == {
        "AXIS": 16, "SLOW": 18, "LATER": 19, "COLOUR": 2, "LEVEL": 1, "SPEED": 2, "SPEEDS": 4, "BOTH": 2, "HANDLE": 0,
        "OUTER": 0, "MOTOR": 0,
    }  # fmt: skip
    assert types["MOTOR"] == Scalar("Motor", ScalarKind.RAW, "V0", 0, is_one=False)


def test_scalars_are_those_of_the_wire() -> None:
    sizes: dict[int, set[str]] = {}
    for scalar in SCALARS.values():
        if scalar.kind is not ScalarKind.RAW:
            sizes.setdefault(scalar.size_bytes, set()).add(scalar.name)
            assert scalar.dtype.lstrip("<")[1:] == str(scalar.size_bytes)
    assert sizes == {
        1: {"BOOL", "BYTE", "USINT", "SINT"},
        2: {"WORD", "UINT", "INT"},
        4: {"DWORD", "UDINT", "DINT", "REAL", "TIME", "TOD", "DATE", "DT"},
        8: {"LWORD", "ULINT", "LINT", "LREAL", "LTIME", "LTOD", "LDATE", "LDT"},
    }
    assert {name: SCALARS[name].unit_ns for name in ("TIME", "TOD", "DATE", "DT", "LTIME", "LDT", "INT")} == {
        "TIME": 10**6, "TOD": 10**6, "DATE": 10**9, "DT": 10**9, "LTIME": 1, "LDT": 1, "INT": 0,
    }  # fmt: skip


PROBLEMS = {
    "VAR_GLOBAL\n a : INT\n b : REAL;\nEND_VAR": "3:2 found 'b', expected ';'",
    "VAR_GLOBAL a : STRING(٣); END_VAR": "1:23 found '٣', which no declaration holds",
    "VAR_GLOBAL x : INT = 5; END_VAR": "1:20 found '=', expected ':='",
    "TYPE S : STRUCT x : INT = 5; END_STRUCT END_TYPE": "1:25 found '=', expected ':='",
    "VAR_GLOBAL a INT; END_VAR": "1:14 found 'INT', expected ',', ':' or AT",
    "VAR_GLOBAL a : ; END_VAR": "1:16 found ';', expected a type",
    "VAR_GLOBAL a : INT;": "1:20 found the end of the text, expected a name or END_VAR",
    "VAR_GLOBAL\r\n\ta : ARRAY [0..3 OF INT; END_VAR": "2:18 found 'OF', expected ',' or ']'",
    "VAR_GLOBAL a : ARRAY [0..3] INT; END_VAR": "1:29 found 'INT', expected OF",
    "VAR_GLOBAL a : ARRAY [..3] OF INT; END_VAR": "1:23 found '..', expected a name or a number",
    "TYPE a : STRUCT b : INT; END_TYPE": "1:26 found 'END_TYPE', expected a name or END_STRUCT",
    "VAR_GLOBAL type : INT; END_VAR": ("1:12 found 'type', expected a name, CONSTANT, END_VAR, PERSISTENT or RETAIN"),
    "VAR_GLOBAL a : INT; § END_VAR": "1:21 found '§', which no declaration holds",
    "x : INT;": "1:1 found 'x', expected TYPE or VAR_GLOBAL",
    "": "1:1 the file is empty",
    "Program notes of the press, by hand": "1:1 the file declares neither types nor variables",
    "VAR_GLOBAL\n {IF defined (LONG)} a : LREAL; {END_IF} END_VAR": (
        "2:2 what is declared here depends on a condition that only the compiler knows"
    ),
    "VAR_GLOBAL a : INT; (* (* *) END_VAR": "1:21 this comment is not closed",
    "VAR_GLOBAL {attribute 'a' END_VAR": "1:12 this pragma is not closed",
    "VAR_GLOBAL a : STRING := 'abc; END_VAR": "1:26 this string is not closed",
    "VAR_GLOBAL a : ARRAY [5..3] OF INT; END_VAR": "1:23 the upper bound 3 is below the lower bound 5",
    "VAR_GLOBAL a : ARRAY [1/0..3] OF INT; END_VAR": "1:25 division by zero",
    "VAR_GLOBAL a : ARRAY ['a'..3] OF INT; END_VAR": "1:23 a constant integer is expected",
    "VAR_GLOBAL a : ARRAY [0..UINT_TO_BYTE(300)] OF INT; END_VAR": "1:39 300 does not fit into BYTE",
    "VAR_GLOBAL a : ARRAY [INT_TO_UINT(-1)..3] OF INT; END_VAR": "1:35 -1 does not fit into UINT",
    "VAR_GLOBAL a : ARRAY [0..REAL_TO_INT(3.0E9)] OF INT; END_VAR": "1:38 3000000000 does not fit into INT",
    "VAR_GLOBAL a : ARRAY [0..REAL_TO_INT(1.0E300 * 1.0E300)] OF INT; END_VAR": (
        "1:38 the value does not fit into 64 bits"
    ),
    "VAR_GLOBAL a : ARRAY [0..2.0] OF INT; END_VAR": "1:26 a constant integer is expected",
    "VAR_GLOBAL a : ARRAY [0..INT_TO_DINT(2.5)] OF INT; END_VAR": "1:38 a constant integer is expected",
    "VAR_GLOBAL a : ARRAY [0..7.5 MOD 2] OF INT; END_VAR": "1:26 a constant integer is expected",
    "VAR_GLOBAL a : ARRAY [0..TRUE AND 3] OF INT; END_VAR": "1:26 a constant integer is expected",
    "VAR_GLOBAL a : ARRAY [0..7 / 0.0] OF INT; END_VAR": "1:30 division by zero",
    "VAR_GLOBAL a : ARRAY [0..NOT 3] OF INT; END_VAR": ("1:30 NOT(3) depends on the bits of a type that nobody knows"),
    "VAR_GLOBAL a : ARRAY [0..-1 AND 3] OF INT; END_VAR": (
        "1:26 -1 AND 3 depends on the bits of a type that nobody knows"
    ),
    "VAR_GLOBAL a : ARRAY [0..ROL(16#81, 1)] OF INT; END_VAR": (
        "1:26 ROL(129, 1) depends on the bits of a type that nobody knows"
    ),
    "VAR_GLOBAL a : ARRAY [0..ROR(1, 1)] OF INT; END_VAR": (
        "1:26 ROR(1, 1) depends on the bits of a type that nobody knows"
    ),
    "VAR_GLOBAL a : ARRAY [0..SEL(3, 1, 2)] OF INT; END_VAR": "1:26 a constant integer is expected",
    "VAR_GLOBAL a : ARRAY [0..MUX(-1, 1, 2)] OF INT; END_VAR": "1:26 a constant integer is expected",
    "VAR_GLOBAL a : ARRAY [0..EXPT(-2.0, 0.5)] OF INT; END_VAR": "1:26 a constant integer is expected",
    "VAR_GLOBAL a : ARRAY [0..MAX(STRING(10))] OF INT; END_VAR": "1:30 a constant integer is expected",
    "VAR_GLOBAL a : ARRAY [0..SIZEOF(POINTER TO INT)] OF INT; b : INT; END_VAR": (
        "1:33 nobody knows SIZEOF(POINTER), which depends on the controller"
    ),
    "VAR_GLOBAL a : ARRAY [0..INT_TO_DINT[3]] OF INT; END_VAR": "1:26 a constant integer is expected",
    "VAR_GLOBAL a : ARRAY [0..SIZEOF(3)] OF INT; END_VAR": "1:26 a constant integer is expected",
    "TYPE S : STRUCT m : INT; END_STRUCT END_TYPE VAR_GLOBAL a : ARRAY [0..SIZEOF(S)] OF INT; END_VAR": (
        "1:78 nobody knows SIZEOF(S), which depends on the controller"
    ),
    "VAR_GLOBAL a : ARRAY [0..SIZEOF(__XWORD)] OF INT; END_VAR": (
        "1:33 nobody knows SIZEOF(__XWORD), which depends on the controller"
    ),
    "VAR_GLOBAL a : ARRAY [0..LEN('abc')] OF INT; END_VAR": "1:26 a constant integer is expected",
    "VAR_GLOBAL a : ARRAY [0..EXPT(2, -1)] OF INT; END_VAR": "1:26 EXPT(2, -1) is no integer of 64 bits",
    "VAR_GLOBAL a : ARRAY [0..EXPT(10, 9999999)] OF INT; END_VAR": "1:26 EXPT(10, 9999999) is no integer of 64 bits",
    "VAR_GLOBAL a : ARRAY [0..EXPT(10, 60)] OF INT; END_VAR": "1:26 the value does not fit into 64 bits",
    "VAR_GLOBAL a : ARRAY [0..SHL(1, 99)] OF INT; END_VAR": "1:26 SHL(1, 99) is no integer of 64 bits",
    "VAR_GLOBAL a : ARRAY [0..LIMIT(1, 2)] OF INT; END_VAR": "1:26 a constant integer is expected",
    "VAR_GLOBAL a : ARRAY [0..99999999999999999999] OF INT; END_VAR": "1:26 the value does not fit into 64 bits",
    "VAR_GLOBAL a : ARRAY [1..1000, 1..101] OF INT; END_VAR": (
        "1:32 the array has 101 000 elements, more than 100 000"
    ),
    "VAR_GLOBAL a, b : ARRAY [1..60000] OF INT; END_VAR": (
        "1:15 the list has 120 000 elements up to here, more than 100 000"
    ),
    "VAR_GLOBAL a : STRING(32768); END_VAR": "1:23 a string of 32768 characters cannot be",
    "VAR_GLOBAL a : STRING(0); END_VAR": "1:23 a string of 0 characters cannot be",
    "VAR_GLOBAL a : REAL(0..1); END_VAR": "1:16 REAL has no subranges",
    "VAR_GLOBAL a : SINT(0..128); END_VAR": "1:24 128 does not fit into SINT",
    "VAR_GLOBAL a, A : INT; END_VAR": "1:15 A is declared twice",
    "TYPE S : STRUCT a : INT; a : INT; END_STRUCT END_TYPE": "1:26 a is declared twice",
    "TYPE E : (a, b, A); END_TYPE": "1:17 A is declared twice",
    "TYPE E : (a := 255, b) USINT; END_TYPE": "1:21 256 does not fit into USINT",
    "TYPE E : (a) REAL; END_TYPE": "1:14 REAL is no integer",
    "TYPE INT : BOOL; END_TYPE": "1:6 INT is an elementary type and cannot be declared",
    "TYPE A : INT; END_TYPE TYPE a : UINT; END_TYPE": "1:29 the type a is declared twice, differently",
    "TYPE A EXTENDS B : STRUCT END_STRUCT B : INT; END_TYPE": "1:16 B is no structure and cannot be extended",
    "TYPE A : STRUCT b : B; END_STRUCT B : ARRAY [0..1] OF A; END_TYPE": ("1:55 the type A contains itself: A → B → A"),
    "VAR_GLOBAL CONSTANT n : INT := m; m : INT := n; END_VAR VAR_GLOBAL a : INT(0..n); END_VAR": (
        "1:46 the constant 'n' depends on itself"
    ),
    f"VAR_GLOBAL a : {'ARRAY [0..0] OF ' * 101} INT; END_VAR": "1:16 types are nested deeper than 100",
}


@pytest.mark.parametrize("text", PROBLEMS)
def test_mistakes_are_named_with_their_place(text: str, tmp_path: Path) -> None:
    assert problem(text, tmp_path) == PROBLEMS[text]


@pytest.mark.parametrize(
    "text",
    [
        "TYPE " + " ".join(f"T{i} : STRUCT a : T{i + 1}; END_STRUCT" for i in range(2_000)) + " END_TYPE",
        "VAR_GLOBAL CONSTANT " + "".join(f"c{i} : INT := c{i + 1};" for i in range(2_000)) + " END_VAR "
        "VAR_GLOBAL a : INT(0..c0); END_VAR",
        f"VAR_GLOBAL a : INT(0..{'(' * 5_000}1{')' * 5_000} + 1/0); END_VAR",
        f"VAR_GLOBAL a : INT(0..{'-' * 5_000}1 + 1/0); END_VAR",
        f"VAR_GLOBAL a : INT(0..{'1+' * 5_000}1); END_VAR",
        f"VAR_GLOBAL a : INT(0..{'INT_TO_DINT(' * 5_000}1{')' * 5_000}); END_VAR",
        f"VAR_GLOBAL a : {'STRUCT a : ' * 3_000}",
        "TYPE A : STRUCT END_STRUCT B : ARRAY [0..99999] OF ARRAY [0..99999] OF A; END_TYPE",
        "TYPE U0 : UNION a : INT; END_UNION "
        + " ".join(f"U{i + 1} : UNION a, b : U{i}; END_UNION" for i in range(40)) + " END_TYPE",
    ],
    ids=["types", "constants", "parentheses", "signs", "sums", "conversions", "structures", "empty", "unions"],
)  # fmt: skip
def test_nothing_that_a_file_says_is_too_much(text: str, tmp_path: Path) -> None:
    assert problem(text, tmp_path)


UNKNOWN = {
    "VAR_GLOBAL (* ' *) a : ITN; END_VAR": ["1:24 ITN"],
    "VAR_GLOBAL a : ARRAY [5..n] OF INT; END_VAR": ["1:26 n constant"],
    "TYPE Axis : INT; END_TYPE VAR_GLOBAL a : Axsi; END_VAR": ["1:42 Axsi near Axis"],
    # Neither what is being declared nor what is elementary is near.
    "TYPE Axis : STRUCT a : Axsi; b : DDINT; END_STRUCT END_TYPE VAR_GLOBAL a : Axis; END_VAR": [
        "1:24 Axsi",
        "1:34 DDINT",
    ],
    "VAR_GLOBAL CONSTANT nMax : INT := 5; END_VAR VAR_GLOBAL a : STRING(nMxa); END_VAR": [
        "1:68 nMxa constant near NMAX"
    ],
    "VAR_GLOBAL a : INT(0..n); b : ARRAY [0..n] OF Axis; c : axis; END_VAR": ["1:23 n constant", "1:47 Axis"],
    "TYPE E : (a := n, b); F : (c) Base; S EXTENDS Base : STRUCT END_STRUCT END_TYPE "
    "VAR_GLOBAL e : E; f : F; s : S; END_VAR": ["1:16 n constant", "1:31 Base"],
    "VAR_GLOBAL CONSTANT n : INT := m + 1; END_VAR VAR_GLOBAL a : ARRAY [0..n] OF INT; END_VAR": ["1:32 m constant"],
    "VAR_GLOBAL a : FELD[0..4]; b : FELD[0..4] OF INT; END_VAR": ["1:16 FELD"],
    # What no list needs is not looked at.
    "TYPE Other : STRUCT x : PVOD; y : Nowhere; END_STRUCT END_TYPE VAR_GLOBAL a : INT; END_VAR": [],
}  # fmt: skip


@pytest.mark.parametrize("text", UNKNOWN)
def test_names_that_no_file_declares_are_told_all_at_once(text: str, tmp_path: Path) -> None:
    found = declared(text, tmp_path)
    assert [
        f"{one.position.line}:{one.position.column} {one.name}{' constant' * one.constant}"
        + (f" near {one.nearest}" if one.nearest else "")
        for one in found.flaws_of(found.lists)
        if isinstance(one, UnknownName)
    ] == UNKNOWN[text]
    assert found.lists


def test_what_has_an_unknown_name_is_of_unknown_size(tmp_path: Path) -> None:
    text = (
        "TYPE E : (a := n, b) UINT; S EXTENDS Base : STRUCT END_STRUCT END_TYPE VAR_GLOBAL "
        "a : Axis; b : STRING(n); c : ARRAY [0..n] OF INT; d : INT(0..n); e : E; s : S; i : INT; END_VAR"
    )
    (entry,) = declared(text, tmp_path).lists
    assert {each.name: size_bytes_of(each.type) for each in entry.variables} == {
        "a": 0, "b": 0, "c": 0, "d": 2, "e": 2, "s": 0, "i": 2,
    }  # fmt: skip


def test_types_of_common_libraries_have_the_size_that_is_public(tmp_path: Path) -> None:
    text = (
        "VAR_GLOBAL a : T_MaxString; b : Tc2_System.T_AmsNetID; c : HRESULT; d : T_FILETIME; e : DCTIMESTRUCT; "
        "f : PVOID; g : T_Unheard; END_VAR"
    )
    found = declared(text, tmp_path)
    (entry,) = found.lists
    assert [size_bytes_of(each.type) for each in entry.variables] == [256, 24, 4, 8, 20, 0, 0]
    assert [one.name for one in found.flaws_of(found.lists) if isinstance(one, UnknownName)] == ["T_Unheard"]
    # What the project declares itself goes before.
    own = declared(f"TYPE T_MaxString : STRING(9); END_TYPE {text}", tmp_path).lists[0].variables[0]
    assert size_bytes_of(own.type) == 10


def test_a_circle_of_constants_that_hang_on_an_unknown_one_ends(tmp_path: Path) -> None:
    """What was looked at when the unknown name came up is not held to be looked at still."""
    text = (
        "VAR_GLOBAL CONSTANT a : INT := b; b : INT := nowhere; c : INT := 3; END_VAR "
        "VAR_GLOBAL x : INT(0..a); y : INT(0..b); z : INT(0..c); END_VAR"
    )
    found = declared(text, tmp_path)
    assert [one.name for one in found.flaws_of(found.lists) if isinstance(one, UnknownName)] == ["nowhere"]
    kinds = [shown(each.type) for entry in found.lists for each in entry.variables]
    assert kinds == ["INT", "INT", "INT(0..3)"]
