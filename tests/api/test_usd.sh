#!/bin/bash
# scene.usda and scene.usdz are as USD's own library wants them, and say what they should: PyPI's usd-core validates them
# and reads names, lights, materials and cameras.
set -u
build=${1:-${UNBAKE_BUILD:-build}}
work=$(mktemp -d "${TMPDIR:-/tmp}/unbake-usd-XXXXXX")
trap 'rm -rf "$work"' EXIT
venv=build/usd
[ -x "$venv/bin/python" ] || python3 -m venv "$venv" >"$work/pip" 2>&1
"$venv/bin/python" -c 'from pxr import UsdValidation' 2>/dev/null ||
    timeout 120 "$venv/bin/pip" install -q usd-core==26.11 >>"$work/pip" 2>&1 ||
    { echo "the library usd-core cannot be had: $(tail -n 1 "$work/pip")"; exit 77; }
"$build/tests/unit/test_usd" "$work" || exit 1

cat >"$work/check.py" <<'PY'
import math, sys
from pxr import Gf, Usd, UsdGeom, UsdLux, UsdShade, UsdValidation

def check(held, what):
    if not held:
        sys.exit(f"{path}: {what}")

for path in sys.argv[1:]:
    stage = Usd.Stage.Open(path)
    context = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())
    for error in context.Validate(stage):
        check(False, f"{error.GetName()}: {error.GetMessage()}")
    check(UsdGeom.GetStageUpAxis(stage) == "Y" and UsdGeom.GetStageMetersPerUnit(stage) == 1, "axis, unit")
    check("not nits" in stage.GetRootLayer().customLayerData["radianceUnit"], "unit of radiance")
    check(stage.GetRootLayer().customLayerData["cleanMipLevel"] == 1, "clean level")
    cache = UsdGeom.XformCache()
    room = cache.GetLocalToWorldTransform(stage.GetDefaultPrim())
    # z is up, and y is 1000 m off: z to y, y to -z.
    check(room.TransformAffine(Gf.Vec3d(1, 2, 3)) == Gf.Vec3d(1, 3, -1002), "turn and offset")
    meshes = {p.GetCustomDataByKey("segment"): p for p in stage.Traverse() if p.IsA(UsdGeom.Mesh)}
    check(meshes[0].GetDisplayName() == 'floor "oak" ' and meshes[2].GetDisplayName() == "\u5899-1", "names")
    emitters = [p for p in meshes.values() if p.HasAPI(UsdLux.MeshLightAPI)]
    check(len(emitters) == 2, "two lamps")
    patterns = 0
    for prim in meshes.values():
        mesh = UsdGeom.Mesh(prim)
        points, st = mesh.GetPointsAttr().Get(), UsdGeom.PrimvarsAPI(prim).GetPrimvar("st")
        check(len(st.Get()) == len(points) == len(mesh.GetNormalsAttr().Get()), "vertices")
        check(max(mesh.GetFaceVertexIndicesAttr().Get()) == len(points) - 1, "indices")
        check(mesh.GetExtentAttr().Get() == UsdGeom.PointBased.ComputeExtent(points), "extent")
        material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
        surface = material.ComputeSurfaceSource()[0]
        emission = surface.GetInput("emissiveColor")
        check(bool(emission) == (prim in emitters), "emission")
        check(mesh.GetDoubleSidedAttr().Get() == (prim not in emitters), "sides")
        source = emission.GetConnectedSources()[0] if emission else []
        patterns += len(source)
        if emission and not source:
            check(abs(Gf.Vec3f(emission.Get())[1] - 15) < 1e-3, "radiance")
    check(patterns == 1, "one lamp shows a picture")
    lights = {p.GetName(): p for p in stage.GetPrimAtPath("/Room/Lights").GetChildren()}
    sky, sun = UsdLux.DomeLight(lights["Sky"]), UsdLux.DistantLight(lights["Sun"])
    check(sky.GetTextureFileAttr().Get().resolvedPath.endswith("sky.exr" if ".usda" in path else "sky.exr]"), "sky")
    check(abs(UsdLux.LightAPI(sun).GetIntensityAttr().Get() - 3) < 1e-5, "irradiance")
    check(abs(sun.GetAngleAttr().Get() - math.degrees(2 * 0.0047)) < 1e-4, "disc")
    way = cache.GetLocalToWorldTransform(lights["Sun"]).TransformDir(Gf.Vec3d(0, 0, -1))
    # From (1, 1, 0), which the turn takes to (1, 0, -1).
    check((way - Gf.Vec3d(-1, 0, 1).GetNormalized()).GetLength() < 1e-6, f"sun shines along {way}")
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/Room/Cameras/view_0")).GetCamera(Usd.TimeCode.Default())
    # Ours looks along x; the pixel (0, 0) is at ((0 - 76) / 100, (0 - 63) / 104) of its picture plane, y down.
    window = camera.frustum.GetWindow()
    check(abs(window.GetMin()[0] + 0.76) < 1e-6 and abs(window.GetMax()[1] - 63 / 104) < 1e-6, "window of the camera")
    check((camera.frustum.ComputeViewDirection() - Gf.Vec3d(1, 0, 0)).GetLength() < 1e-6, "view of the camera")
PY
"$venv/bin/python" "$work/check.py" "$work/scene.usda" "$work/scene.usdz"
