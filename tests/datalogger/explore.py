import sys, sqlite3, traceback, shutil, re
from pathlib import Path
from tests.datalogger.oracle import *
from tests.datalogger.oracle_losses import Doubt
from tests.datalogger.plants import *
from tests.program import run_text
import tempfile
def files_of(db):
    return {p.name[len(db.name):]: p for p in sorted(db.parent.glob(db.name + "*"))}
def read(path):
    c = sqlite3.connect(f"file:{path}?mode=ro", uri=True)
    assert c.execute("pragma integrity_check").fetchall() == [("ok",)]
    assert [c.execute(f"pragma {p}").fetchone()[0] for p in ("page_size","auto_vacuum","user_version")] == [4096,1,0]
    (name, sql), = c.execute("select name, sql from sqlite_master")
    return name, sql, rows_of(c, name)
def one(seed, folder):
    plant = drawn_plant(seed)
    try:
        expected = recorded(plant.packets, plant.lists, plant.session, folder)
    except Doubt as e:
        return "doubt"
    caps = plant.write(folder / "x")
    out = folder / "x" / "log.db"
    done = run_text("datalog", *caps, "--config", folder/"x"/"log.xml", *(["--document-style"] if plant.session.document_style else []), "-w", out, "--project", folder/"x"/"nvscope.toml", cwd=folder/"x")
    if done.returncode not in (0, 3):
        return f"code {done.returncode} {done.stderr} {done.stdout}"
    got = {suffix: read(p) for suffix, p in files_of(out).items()}
    names = sorted(plant.session.variables)
    kinds = {(o.index, n): k for o in plant.lists for n, k in o.fields}
    f = {s: r for s, (_, _, r) in got.items()}
    for n, sql, _ in got.values():
        assert sql == create_table(n, plant.session, names, [declared(kinds[plant.session.variables[x]]) for x in names]), sql
        assert re.fullmatch(r"log_changes_\d+" if plant.session.changes_only else r"log_\d+", n)
    e = {s: [tuple(map(as_it_is, r)) for r in [(*x[:3], *x[3]) for x in v]] for s, v in expected.items()}
    g = {s: [tuple(map(as_it_is, r)) for r in [(*x[:3], *x[3]) for x in v]] for s, v in f.items()}
    if e == g: return "same"
    first = lambda d: {k: [r if i or r[2][1] not in "01" else (*r[:2], "x", *r[3:]) for i, r in enumerate(v)] for k, v in d.items()}
    if first(e) == first(g): return "same but first"
    msg = [str(plant.session), f"files {[(k, len(v)) for k, v in e.items()]} got {[(k, len(v)) for k, v in g.items()]}", done.stderr]
    for s in sorted(set(e) | set(g)):
        a, b = e.get(s), g.get(s)
        if a != b:
            for i, (x, y) in enumerate(zip(a or [], b or [])):
                if x != y:
                    msg.append(f"file {s!r} row {i}:\n  exp {[v for _, v in x]}\n  got {[v for _, v in y]}"); break
            break
    return "\n".join(msg)
if __name__ == "__main__":
    a, b = int(sys.argv[1]), int(sys.argv[2])
    from collections import Counter
    tally = Counter(); shown = 0
    for seed in range(a, b):
        folder = Path(tempfile.mkdtemp(dir="/dev/shm"))
        try: r = one(seed, folder)
        except Exception: r = traceback.format_exc()
        shutil.rmtree(folder)
        tally[r if r in ("same", "doubt", "same but first") else "differs"] += 1
        if r not in ("same", "doubt", "same but first"):
            shown += 1
            if shown <= int(sys.argv[3]): print("=== seed", seed, r[:2500])
    print(tally)
