"""FLIP (Andersson et al. 2020) between pictures of the recovered and of the true room, as rows of a table.

Noise of renders is error to FLIP, and neither adds up nor can be taken out as of a mean square. So pictures are single renders
of equal noise, and a row beside says what FLIP is between two renders of the true room itself: noise alone.

usage: flip.py LABEL DIR ...: of each DIR/LIGHTING_N_o1.png and _b.png against DIR/LIGHTING_N_a.png, the mean over N; on
standard output "what (LABEL)<TAB>value<TAB>-<TAB>lower"."""
import collections
import glob
import sys

import flip_evaluator


def main(label, folders):
    errors = collections.defaultdict(list)
    for folder in folders:
        for true in sorted(glob.glob(f"{folder}/*_a.png")):
            lighting = true.rsplit("/", 1)[1].rsplit("_", 2)[0]
            for what, ending in (("FLIP", "_o1.png"), ("FLIP of noise alone", "_b.png")):
                _, mean, _ = flip_evaluator.evaluate(true, true[: -len("_a.png")] + ending, "LDR")
                errors[lighting, what].append(mean)
    for (lighting, what), found in errors.items():
        print(f"{lighting}: {what} ({label})\t{sum(found) / len(found):.6g}\t-\tlower")


main(sys.argv[1], sys.argv[2:])
