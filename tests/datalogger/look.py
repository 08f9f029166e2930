import sys, tempfile, shutil
from tests.datalogger.explore import *
def look(seed, around=3):
    folder = Path(tempfile.mkdtemp(dir="/dev/shm"))
    p = drawn_plant(seed)
    exp = recorded(p.packets, p.lists, p.session, folder)
    one(seed, folder)
    got = {s: read(q)[2] for s, q in files_of(folder/"x"/"log.db").items()}
    s = p.session
    print(f"seed {seed} sampling {s.sampling_ns/1e6} publish {s.publish_ns/1e6} cap {s.capacity} task {s.task} tasks {set(s.tasks.values())} changes {s.changes_only} vars {set(i for i,_ in s.variables.values())}")
    print([(l.index, l.name, l.interval_ns, len(l.telegrams)) for l in p.lists], len(p.packets))
    def t(ns): return f"{(ns-START_NS)/1e6:.3f}"
    def rt(r): 
        if isinstance(r.timestamp, int): return t(((r.timestamp & ((1<<62)-1)) - EPOCH_TICKS)*100)
        return r.timestamp[14:]
    diffs = []
    for k in exp:
        a, b = exp[k], got.get(k, [])
        for i in range(max(len(a), len(b))):
            x, y = (a[i] if i < len(a) else None), (b[i] if i < len(b) else None)
            if x is None or y is None or list(map(as_it_is,(*x[:3],*x[3]))) != list(map(as_it_is,(*y[:3],*y[3]))):
                print("file", repr(k), "row", i, "exp", x and (rt(x), x.consistent, [str(c)[:6] for c in x.columns]), "got", y and (rt(y), y.consistent, [str(c)[:6] for c in y.columns]))
                diffs.append(i)
                if len(diffs) > 6: break
    from tests.datalogger.oracle_losses import losses, Counters
    by = {o.index: o for o in p.lists}
    of = {i for i, _ in s.variables.values()}
    L = losses(p.packets, {i: by[i].interval_ns for i in of}, [counts_for(q, by.get(q.index)) for q in p.packets])
    c = Counters(p.packets)
    print("losses", sorted(L), "scopes", {n: c.scope(n) for n in c.nodes})
    for i, q in enumerate(p.packets):
        if "-v" in sys.argv or any(abs(i - l) <= around for l in L):
            print(i, t(q.time_ns), q.node, q.index, q.subindex, "cnt", q.counter, "items", q.items, len(q.data), "wf" if q.well_formed else "MALF", "svc", q.service, "LOSS" if i in L else "", "drops" if q.drops else "")
    shutil.rmtree(folder)
look(int(sys.argv[1]))
