import collections
import sys

from campaigns.worker import Worker

fn, a, b = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
c = collections.Counter()
seen = collections.Counter()
with Worker(fn, 30.0) as w:
    for x in w.answers(0, range(a, b)):
        c[x.kind] += 1
        if not x.good or x.seconds > 15:
            key = (x.text.strip().splitlines() or [""])[-1][:150]
            seen[key] += 1
            if seen[key] <= 1:
                print("#", x.index, x.kind, round(x.seconds, 1))
                print(x.text[-1500:])
                print(flush=True)
print(c)
print(seen.most_common())
