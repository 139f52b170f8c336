"""FLIP (Andersson et al. 2020) between pictures of the recovered and of the true room, as rows of a table.

usage: flip.py LABEL DIR ...: of each DIR/LIGHTING_N_ours.png against DIR/LIGHTING_N_true.png, the mean over N; on standard
output "what (LABEL)<TAB>value<TAB>-<TAB>lower". The pictures keep what noise their renders have."""
import collections
import glob
import sys

import flip_evaluator


def main(label, folders):
    errors = collections.defaultdict(list)
    for folder in folders:
        for ours in sorted(glob.glob(f"{folder}/*_ours.png")):
            lighting = ours.rsplit("/", 1)[1].rsplit("_", 2)[0]
            _, mean, _ = flip_evaluator.evaluate(ours.replace("_ours.png", "_true.png"), ours, "LDR")
            errors[lighting].append(mean)
    for lighting, found in errors.items():
        print(f"{lighting}: FLIP ({label})\t{sum(found) / len(found):.6g}\t-\tlower")


main(sys.argv[1], sys.argv[2:])
