"""Definition files made to take long or much memory; what each costs must be in proportion to its size, or refused."""

from __future__ import annotations

from collections.abc import Callable

Files = dict[str, str]


def gvl(declarations: str, index: int = 1, *, pack: bool = True, port: int = 1202, before: str = "") -> str:
    """Return an exported list with these declarations."""
    return f"""<GVL><Declarations><![CDATA[{before}VAR_GLOBAL
{declarations}
END_VAR]]></Declarations><NetvarSettings Protocol="UDP"><ListIdentifier>{index}</ListIdentifier><Pack>{pack}</Pack>
<Interval>T#50ms</Interval><ProtocolSettings><ProtocolSetting Name="Port" Value="{port}" /></ProtocolSettings>
</NetvarSettings></GVL>
"""


def large_array(count: int) -> Files:
    return {"a.gvl": gvl(f"a : ARRAY[1..{count}] OF BYTE;")}


def large_array_unpacked(count: int) -> Files:
    return {"a.gvl": gvl(f"a : ARRAY[1..{count}] OF BYTE;", pack=False)}


def many_variables(count: int) -> Files:
    return {"a.gvl": gvl("\n".join(f"v{number} : INT;" for number in range(count)))}


def many_variables_unpacked(count: int) -> Files:
    return {"a.gvl": gvl("\n".join(f"v{number} : INT;" for number in range(count)), pack=False)}


def many_names_in_one_declaration(count: int) -> Files:
    return {"a.gvl": gvl(", ".join(f"v{number}" for number in range(count)) + " : INT;")}


def nested_arrays(depth: int) -> Files:
    return {"a.gvl": gvl("a : " + "ARRAY[0..0] OF " * depth + "INT;")}


def nested_structures(depth: int) -> Files:
    return {"a.gvl": gvl("a : " + "STRUCT m : " * depth + "INT; " + "END_STRUCT; " * depth)}


def chain_of_types(count: int) -> Files:
    chain = "".join(f"TYPE T{number} : STRUCT m : T{number + 1}; END_STRUCT END_TYPE\n" for number in range(count))
    return {"a.gvl": gvl("a : T0;"), "t.st": f"{chain}TYPE T{count} : INT; END_TYPE\n"}


def chain_of_types_backwards(count: int) -> Files:
    chain = "".join(f"TYPE T{number} : STRUCT m : T{number - 1}; END_STRUCT END_TYPE\n" for number in range(1, count))
    return {"a.gvl": gvl(f"a : T{count - 1};"), "t.st": f"TYPE T0 : INT; END_TYPE\n{chain}"}


def doubled_structures(depth: int) -> Files:
    """Each structure has the one before twice: 2 to the power of the depth elements."""
    chain = "".join(
        f"TYPE T{number} : STRUCT a, b : T{number - 1}; END_STRUCT END_TYPE\n" for number in range(1, depth)
    )
    return {"a.gvl": gvl(f"a : T{depth - 1};"), "t.st": f"TYPE T0 : INT; END_TYPE\n{chain}"}


def doubled_names(depth: int) -> Files:
    """Names of elements as long as all names of the types above together."""
    chain = "".join(
        f"TYPE T{number} : STRUCT {'n' * 300}{number} : T{number - 1}; END_STRUCT END_TYPE\n"
        for number in range(1, depth)
    )
    return {"a.gvl": gvl(f"a : ARRAY[1..50000] OF T{depth - 1};"), "t.st": f"TYPE T0 : INT; END_TYPE\n{chain}"}


def long_name_of_array(length: int) -> Files:
    return {"a.gvl": gvl(f"{'n' * length} : ARRAY[1..100000] OF BYTE;")}


def extends_in_a_circle(count: int) -> Files:
    types = "".join(
        f"TYPE T{number} EXTENDS T{(number + 1) % count} : STRUCT a{number} : INT; END_STRUCT END_TYPE\n"
        for number in range(count)
    )
    return {"a.gvl": gvl("a : T0;"), "t.st": types}


def extends_in_a_chain(count: int) -> Files:
    """Each structure has all members of those before it: a square of members."""
    types = "".join(
        f"TYPE T{number} EXTENDS T{number - 1} : STRUCT a{number} : INT; END_STRUCT END_TYPE\n"
        for number in range(1, count)
    )
    return {"a.gvl": gvl(f"a : T{count - 1};"), "t.st": f"TYPE T0 : STRUCT a0 : INT; END_STRUCT END_TYPE\n{types}"}


def large_constants(count: int) -> Files:
    return {"a.gvl": gvl(f"a : ARRAY[0..{'*'.join(['16#FFFF'] * count)}] OF INT;")}


def constants_of_constants(count: int) -> Files:
    lines = "\n".join(f"C{number} : INT := C{number - 1} + C{number - 1};" for number in range(1, count))
    constants = f"VAR_GLOBAL CONSTANT\nC0 : INT := 0;\n{lines}\nEND_VAR\n"
    return {"a.gvl": gvl(f"a : ARRAY[0..C{count - 1}] OF INT;", before=constants)}


def nested_brackets(depth: int) -> Files:
    return {"a.gvl": gvl(f"a : ARRAY[0..{'(' * depth}1{')' * depth}] OF INT;")}


def long_sum(count: int) -> Files:
    return {"a.gvl": gvl(f"a : ARRAY[0..{'+'.join(['1'] * count)}] OF INT;")}


def many_values(count: int) -> Files:
    values = ", ".join(f"v{number}" for number in range(count))
    return {"a.gvl": gvl("a : E; b : ARRAY[0..200] OF E;"), "t.st": f"TYPE E : ({values}) DINT; END_TYPE\n"}


def many_enumerations_of_the_same_names(count: int) -> Files:
    types = "".join(f"TYPE E{number} : (off, on, last := on + 1); END_TYPE\n" for number in range(count))
    return {"a.gvl": gvl("a : E0;"), "t.st": types}


def one_identifier(count: int) -> Files:
    """As many definitions of one list, each of another shape."""
    return {f"a{number}.gvl": gvl("a : INT;\n" * 1 + f"b : STRING({number + 1});") for number in range(count)}


def many_lists(count: int) -> Files:
    return {f"a{number}.gvl": gvl("a : INT; b : REAL;", number) for number in range(count)}


def long_strings_unpacked(count: int) -> Files:
    return {"a.gvl": gvl("\n".join(f"s{number} : STRING(32767);" for number in range(count)), pack=False)}


def long_strings_in_arrays(count: int) -> Files:
    return {"a.gvl": gvl(f"s : ARRAY[1..{count}] OF WSTRING(32767);", pack=False)}


def large_comment(size: int) -> Files:
    return {"a.gvl": gvl(f"(* {'x' * size} *) a : INT;")}


def open_comments(count: int) -> Files:
    return {"a.gvl": gvl(f"{'(* ' * count} a : INT;")}


def many_attributes(count: int) -> Files:
    return {"a.gvl": gvl("{attribute 'x' := 'y'}\n" * count + "a : INT;")}


def long_line(size: int) -> Files:
    return {"a.gvl": gvl(f"a : INT := {'9' * size};")}


def only_brackets(size: int) -> Files:
    return {"a.gvl": "<" * size, "b.st": "(" * size}


def many_initial_values(count: int) -> Files:
    return {"a.gvl": gvl(f"a : ARRAY[0..9] OF INT := [{', '.join(['1'] * count)}];")}


def twins(count: int) -> Files:
    types = "".join(f"TYPE T{n} : STRUCT a : ARRAY[0..99] OF INT; END_STRUCT END_TYPE\n" for n in range(count))
    return {"a.gvl": gvl("a : T0;"), "t.st": types, "u.st": types}


def dimensions(count: int) -> Files:
    return {"a.gvl": gvl(f"a : ARRAY[{','.join(['0..0'] * count)}] OF INT;")}


def empty_structures(count: int) -> Files:
    return {"a.gvl": gvl(f"a : ARRAY[1..{count}] OF T; b : INT;"), "t.st": "TYPE T : STRUCT END_STRUCT END_TYPE\n"}


def unions(count: int) -> Files:
    types = "".join(f"TYPE T{number} : UNION a, b : T{number - 1}; END_UNION END_TYPE\n" for number in range(1, count))
    return {"a.gvl": gvl(f"a : T{count - 1};"), "t.st": f"TYPE T0 : INT; END_TYPE\n{types}"}


def xml_bomb(count: int) -> Files:
    entities = "".join(f'<!ENTITY a{n} "&a{n - 1};&a{n - 1};">' for n in range(1, count))
    return {"a.gvl": f'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a0 "a">{entities}]><GVL>&a{count - 1};</GVL>'}


def deep_xml(depth: int) -> Files:
    return {"a.gvl": f"<GVL>{'<a>' * depth}{'</a>' * depth}</GVL>"}


DEFINITION_FLOODS: dict[str, tuple[Callable[[int], Files], int]] = {
    "large array": (large_array, 100_000),
    "large array, unpacked": (large_array_unpacked, 100_000),
    "too large array": (large_array, 10**18),
    "many variables": (many_variables, 60_000),
    "many variables, unpacked": (many_variables_unpacked, 60_000),
    "many names": (many_names_in_one_declaration, 60_000),
    "nested arrays": (nested_arrays, 3_000),
    "nested structures": (nested_structures, 3_000),
    "chain of types": (chain_of_types, 20_000),
    "chain of types, backwards": (chain_of_types_backwards, 20_000),
    "doubled structures": (doubled_structures, 60),
    "doubled names": (doubled_names, 40),
    "long name of an array": (long_name_of_array, 10_000),
    "extends in a circle": (extends_in_a_circle, 1_000),
    "extends in a chain": (extends_in_a_chain, 5_000),
    "large constants": (large_constants, 20_000),
    "constants of constants": (constants_of_constants, 5_000),
    "nested brackets": (nested_brackets, 50_000),
    "long sum": (long_sum, 100_000),
    "many values": (many_values, 50_000),
    "many enumerations of the same names": (many_enumerations_of_the_same_names, 20_000),
    "one identifier": (one_identifier, 1_000),
    "many lists": (many_lists, 1_000),
    "long strings, unpacked": (long_strings_unpacked, 3_000),
    "long strings in an array": (long_strings_in_arrays, 100_000),
    "large comment": (large_comment, 15_000_000),
    "open comments": (open_comments, 1_000_000),
    "many attributes": (many_attributes, 300_000),
    "long number": (long_line, 5_000_000),
    "only brackets": (only_brackets, 5_000_000),
    "many initial values": (many_initial_values, 200_000),
    "twins": (twins, 5_000),
    "dimensions": (dimensions, 100_000),
    "empty structures": (empty_structures, 100_000),
    "unions": (unions, 100),
    "entities": (xml_bomb, 60),
    "deep XML": (deep_xml, 500_000),
}
"""Who makes a flood of definitions, and of how many."""
