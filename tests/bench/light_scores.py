"""How near the light of a reconstruction comes to the truth of its room: rows of a table.

usage: light_scores.py ROOM OUT LABEL: of the folder OUT and OUT.evaluation.json, by ROOM/truth/lights.json
(light_truth.py); on standard output rows "what (LABEL), value, goal, better" with tabs between. "null": not to be had.

An emitter counts as found if its object emits (in the mean over its area). Hidden lamps count where they bring
LEAST_SHARE of the light of some object that photographs show at LEAST_POINTS points. A stated source (report.json:
lights) is held against its object's true radiance; of skies none is judged."""
import json
import math
import sys

LEAST_SHARE = 0.02
LEAST_POINTS = 20  # fewer are noise


def found_emission(report):
    """By object, power [3] in radiance x area, and area."""
    power, area = {}, {}
    for s in report["segments"]:
        area[s["id"]] = area.get(s["id"], 0.0) + s["area_m2"]
        power[s["id"]] = [a + s["area_m2"] * b for a, b in zip(power.get(s["id"], [0.0] * 3), s["emission"])]
    return power, area


def hidden_that_matter(truth):
    measured = [s for s in truth["segments"] if s["points"] >= LEAST_POINTS]
    return [s for s in truth["sources"] if s.get("hidden") and
            max((m["shares"].get(str(s["object"]), 0.0) for m in measured), default=0.0) >= LEAST_SHARE]


def within(report, truth, deviations):
    """Share of the stated sources of objects whose truth lies within so many of their deviations, or null."""
    true = {s["object"]: sum(s["radiance"]) for s in truth["sources"] if s["kind"] == "lamp"}
    held = []
    for light in report.get("lights", []):
        stated = sum(light["radiance"])
        if "object_id" not in light or stated <= 0 or light["deviation"] is None:
            continue
        right = true.get(light["object_id"], 0.0)
        held.append(right > 0 and abs(math.log(right / stated)) <= deviations * light["deviation"])
    return sum(held) / len(held) if held else None


def rows(report, evaluation, truth):
    power, area = found_emission(report)
    emits = {k for k, p in power.items() if sum(p) > 0}
    shown = {s["object"] for s in truth["segments"]}
    lamps = {s["object"]: s for s in truth["sources"] if s["kind"] == "lamp"}
    seen = [k for k, s in lamps.items() if not s["hidden"]]
    hidden = hidden_that_matter(truth)
    sum_found = sum(sum(power.get(s["object"], [0.0])) for s in hidden)
    sum_true = sum(sum(s["power"]) / math.pi for s in hidden)
    yield "base colour PSNR of seen surface, dB", evaluation["base_color_psnr_db"], "higher"
    yield "roughness PSNR, dB", evaluation["roughness_psnr_db"], "higher"
    yield "specular PSNR, dB", evaluation["specular_psnr_db"], "higher"
    yield "mean base colour by the truth's", evaluation.get("base_color_ratio"), "lower"
    yield f"of {len(seen)} emitters that photographs show, missed", sum(k not in emits for k in seen), "lower"
    yield "false emitters that photographs show", len(emits & shown - set(lamps)), "lower"
    yield "false emitters that no photograph shows", len(emits - shown - set(lamps)), "lower"
    yield f"of {len(hidden)} hidden lamps, found", sum(s["object"] in emits for s in hidden), "higher"
    yield "power of hidden lamps by the truth's", sum_found / sum_true if sum_true else None, "lower"
    for deviations in (1, 2):
        yield f"share of stated sources within {deviations} deviations", within(report, truth, deviations), "higher"


def main():
    room, out, label = sys.argv[1:]
    with open(out + "/report.json") as a, open(out + ".evaluation.json") as b, open(room + "/truth/lights.json") as c:
        report, evaluation, truth = json.load(a), json.load(b), json.load(c)
    for what, value, better in rows(report, evaluation, truth):
        print(f"{what} ({label})", "null" if value is None else round(value, 3), "-", better, sep="\t")


if __name__ == "__main__":
    main()
