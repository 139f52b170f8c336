/* unsupported.c -- see unsupported.h. A table of what people have on their disks; the first row that matches is told.
 */
#include "server/ingest/source/unsupported.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "common/mem.h"
#include "server/ingest/path.h"
#include "server/ingest/source/photo_folder.h"

#define GAUSSIANS "this is a model of 3D Gaussians, not a mesh"
#define GAUSSIANS_HINT "send the data set that it was trained on (images/ and sparse/), with a mesh of it"
#define COLMAP_FIRST "colmap automatic_reconstructor --workspace_path . --image_path IMAGES --dense 1"

/* Patterns are of paths below some folder (fnmatch), any of those between "|"; all of has[] must match there. What the
 * first one matches is blamed. Reason and hint are for the user: what it is, what is missing, what makes it. */
static const struct {
    const char *has[2], *reason, *hint;
} kinds[] = {
    {{"*.sens"},
     "no cameras: this is ScanNet's .sens file, which is not unpacked",
     "unpack it: python reader.py --filename SCENE.sens --output_path . --export_color_images --export_poses "
     "--export_intrinsics (ScanNet/SensReader/python)"},
    {{"odometry.csv", "camera_matrix.csv"},
     "no cameras that are read: this is a recording of Stray Scanner, with its photographs in a video and no mesh",
     "ffmpeg -i rgb.mp4 -vf fps=2 -q:v 2 images/%05d.jpg, then " COLMAP_FIRST},
    {{"*.blend"},
     "no cameras that are read: a .blend file is Blender's own",
     "in Blender, the add-on BlenderNeRF writes transforms_train.json with the photographs; export the mesh as PLY or glTF"},
    {{"*.abc"},
     "no cameras that are read: Alembic (.abc) is not",
     "in Meshroom use cameras.sfm of the node StructureFromMotion; in Metashape or RealityCapture export cameras as XML or CSV"},
    {{"*.usdz|*.usd|*.usda|*.usdc"},
     "no cameras: this is a .usdz of RoomPlan or of a phone's scanner: a model without photographs' poses",
     "export raw data: Polycam Settings, Developer mode, Raw data; or photograph the room and run " COLMAP_FIRST},
    {{"habitat/*|*semantic.json|preseg.json", "*mesh.ply"},
     "no cameras: this is Replica as shipped, which has no photographs",
     "take the rendered set of NICE-SLAM (download_replica.sh), or render views with ReplicaRenderer and add a transforms.json"},
    {{"point_cloud/iteration_*/*.ply|point_cloud.ply|*.splat|*.spz"}, "no cameras: " GAUSSIANS, GAUSSIANS_HINT},
    {{"*.psx|*.psz"},
     "no cameras: this is a project of Metashape's, which only it reads",
     "in Metashape: File, Export, Export Cameras (Agisoft XML), and Export Model in the same coordinates (PLY or OBJ)"},
    {{"*.rcproj|*.rsproj"},
     "no cameras: this is a project of RealityCapture's, which only it reads",
     "in RealityCapture (RealityScan) export the registration as \"Internal/External camera parameters\" (CSV) or as XMP, "
     "and the mesh (PLY or OBJ)"},
    {{"*.mg"},
     "no cameras: this is Meshroom's project, which has none itself",
     "its folder MeshroomCache has them: StructureFromMotion/*/cameras.sfm, and the mesh Texturing/*/texturedMesh.obj"},
    {{"*.nvm"},
     "no cameras that are read: VisualSFM's .nvm is not",
     "VisualSFM writes bundle.rd.out and list.txt, too, which are read"},
    {{"database.db"},
     "no cameras: this is COLMAP's database, without the model that is made of it",
     "colmap mapper --database_path database.db --image_path images --output_path sparse"},
    {{"*.xyz|*.e57|*.pts|*.ptx|*.las|*.laz", "*.obj|*.ply|*.glb"},
     "no cameras: this is a MatterPak or a scanner's export: a mesh and a point cloud without the photographs' poses",
     "photographs with poses are needed: of a Matterport scan only the raw data has them; or photograph the room and run " COLMAP_FIRST},
    {{"*.e57|*.pts|*.ptx|*.las|*.laz"},
     "no cameras: this is a laser scanner's point cloud, without photographs' poses",
     "photograph the room and run " COLMAP_FIRST},
};

/* A PLY of 3D Gaussians, which looks like a point cloud's by its name: its path, the caller's. NULL: none. */
static char *find_gaussians(const struct listing *l) {
    char *path = NULL;
    for (size_t i = 0; i < l->folder_count && !path; i++)
        path = listing_first_with(l, l->folder[i], "*.ply", "f_dc_0", "opacity");
    return path;
}

/* Whether any of the patterns between "|" matches a file below the base; its path. */
static const char *any_match(const struct listing *l, const char *base, const char *patterns) {
    char *copy = mem_strdup(patterns), *rest = copy, *pattern;
    const char *found = NULL;
    while (!found && (pattern = strsep(&rest, "|")) != NULL) {
        const struct listed_file *file = listing_first(l, base, pattern);
        found = file ? file->path : NULL;
    }
    mem_free(copy);
    return found;
}

/* The path that the first pattern of the row matches in some folder where all do; NULL: not of this kind. */
static const char *match(const struct listing *l, size_t kind) {
    for (size_t i = 0; i < l->folder_count; i++) {
        const char *first = any_match(l, l->folder[i], kinds[kind].has[0]);
        bool has_all = first != NULL;
        for (int k = 1; k < 2 && kinds[kind].has[k]; k++)
            has_all = has_all && any_match(l, l->folder[i], kinds[kind].has[k]);
        if (has_all)
            return first;
    }
    return NULL;
}

static void tell(struct findings *f, const char *file, const char *reason, const char *hint) {
    struct error own;
    error_set(&own, STATUS_INPUT, "%s", reason);
    error_hint(&own, "%s", hint);
    findings_error(f, file, &own);
}

struct bundle_contents {
    size_t photographs, raw, meshes;
    const char *first_photograph, *first_raw, *first_mesh, *video;
};

static bool ends_in(const char *path, const char *const *extensions) {
    for (; *extensions; extensions++)
        if (strcasecmp(path_extension(path), *extensions) == 0)
            return true;
    return false;
}

static struct bundle_contents look(const struct listing *l) {
    static const char *const raw[] = {"dng", "cr2", "cr3", "nef", "arw", "raf", "orf", "rw2", "pef", NULL};
    static const char *const meshes[] = {"ply", "obj", "glb", "gltf", "stl", "fbx", "dae", NULL};
    static const char *const videos[] = {"mp4", "mov", "m4v", "avi", "mkv", "insv", NULL};
    struct bundle_contents c = {0};
    for (size_t i = l->count; i-- > 0;) {
        const char *path = l->file[i].path;
        if (ends_in(path, videos))
            c.video = path;
        else if (ends_in(path, meshes))
            c.meshes++, c.first_mesh = path;
        else if (ends_in(path, raw))
            c.raw++, c.first_raw = path;
        else if (photo_is_picture(path))
            c.photographs++, c.first_photograph = path;
    }
    return c;
}

/* Files of frames that go by another name than transforms.json: which one is meant is not ours to say. */
static bool tell_renamed_transforms(const struct listing *l, struct findings *f) {
    char reason[300], *path = NULL;
    for (size_t i = 0; i < l->folder_count && !path; i++)
        path = listing_first_with(l, l->folder[i], "*.json", "\"frames\"", "\"transform_matrix\"");
    if (!path)
        return false;
    snprintf(reason, sizeof reason, "no cameras: the bundle has no transforms.json; %.200s has frames, by its looks",
             path);
    tell(f, path, reason, "--scene-set transforms=PATH, or transforms in PATCH /v1/scenes/ID, says which file it is");
    mem_free(path);
    return true;
}

static bool tell_gaussians(const struct listing *l, struct findings *f) {
    char *path = find_gaussians(l);
    if (path)
        tell(f, path, "no cameras: " GAUSSIANS, GAUSSIANS_HINT);
    mem_free(path);
    return path != NULL;
}

void unsupported_tell_cameras(const struct listing *l, const char *chosen, struct findings *f) {
    struct bundle_contents c = look(l);
    char reason[300];
    if (chosen) {
        snprintf(reason, sizeof reason, "no cameras: the bundle has no %.200s", chosen);
        tell(f, chosen, reason, "transforms= names a file of cameras by its path in the bundle");
        return;
    }
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        const char *path = match(l, i);
        if (path) {
            tell(f, path, kinds[i].reason, kinds[i].hint);
            return;
        }
    }
    if (tell_renamed_transforms(l, f) || tell_gaussians(l, f))
        return;
    if (c.video && c.photographs <= 2) {
        tell(f, c.video, "no cameras: this is a video",
             "ffmpeg -i VIDEO -vf fps=2 -q:v 2 images/%05d.jpg, then " COLMAP_FIRST);
    } else if (c.raw > c.photographs) {
        tell(f, c.first_raw, "no cameras: these are photographs as camera raw, without poses",
             "develop them to 16-bit linear TIFF (dcraw -4 -T, or darktable-cli), then " COLMAP_FIRST);
    } else if (c.photographs > 2 && c.meshes > 0) {
        tell(
            f, c.first_photograph, "no cameras: there are photographs and a mesh, but no poses",
            "export the cameras of the program that made the mesh: RealityCapture CSV or XMP, Metashape XML, Meshroom's "
            "cameras.sfm, COLMAP's sparse/; of another mesh they would not fit");
    } else if (c.photographs > 2) {
        tell(f, c.first_photograph, "no cameras: there are only photographs",
             "poses and a mesh of them come from: " COLMAP_FIRST " (add --mesher poisson)");
    } else if (c.meshes > 0) {
        tell(
            f, c.first_mesh,
            "no cameras: there is only a mesh, as free exports of Polycam, Luma, KIRI and Scaniverse "
            "have it: no photographs, no poses",
            "the light is measured in the photographs: export raw data (Polycam: Settings, Developer mode, Raw data), or "
            "photograph the room and run " COLMAP_FIRST);
    } else {
        tell(
            f, "transforms.json", "no cameras: the bundle has no transforms.json, nor poses of another kind",
            "see the list of sources: nerfstudio, COLMAP, Polycam raw data, Metashape, RealityCapture, ScanNet and others");
    }
}

void unsupported_tell_mesh(const struct listing *l, const struct source *source, const char *unread, bool has_clouds,
                           struct findings *f) {
    static const char mvs[] = "a mesh of these cameras: InterfaceCOLMAP -i . -o scene.mvs --image-folder images, then "
                              "DensifyPointCloud scene.mvs && ReconstructMesh scene_dense.mvs (OpenMVS)";
    static const char capture[] = "put the mesh that the same program made of this capture into the folder";
    static const char depth[] =
        "fuse its depth maps in these poses, for example with Open3D's ScalableTSDFVolume, and put the "
        "mesh into the folder";
    static const char *const of_depth[] = {"7-Scenes", "TUM RGB-D", "ScanNet", "ARKitScenes", "Record3D"};
    const char *own = capture;
    for (size_t i = 0; source && i < sizeof of_depth / sizeof *of_depth; i++)
        own = strcmp(source->name, of_depth[i]) == 0 ? depth : own;
    if (source && strstr(source->name, "Replica"))
        own =
            "in NICE-SLAM's archive the mesh lies one folder up, ROOM_mesh.ply beside cam_params.json: put both into the "
            "folder";
    bool is_colmap = source && strstr(source->name, "COLMAP"),
         is_nerfstudio = source && strstr(source->name, "nerfstudio");
    char reason[400], hint[256], *gaussians = unread ? NULL : find_gaussians(l);
    snprintf(reason, sizeof reason,
             unread       ? "no mesh: the format of %.250s is not read; a mesh must be PLY, OBJ or glTF"
             : gaussians  ? "no mesh: %.250s is a model of 3D Gaussians"
             : has_clouds ? "no mesh: the PLY files of the bundle are point clouds"
                          : "no mesh: the bundle has no PLY, OBJ or glTF file",
             unread ? unread : gaussians);
    snprintf(hint, sizeof hint, "%s%s", is_nerfstudio && listing_has_folder(l, "", "colmap") ? "in colmap/, " : "",
             is_colmap || is_nerfstudio ? mvs : own);
    if (is_nerfstudio && !listing_has_folder(l, "", "colmap"))
        snprintf(hint, sizeof hint,
                 "ns-train neus-facto or nerfacto, then ns-export tsdf --save-world-frame True; or of "
                 "COLMAP's reconstruction InterfaceCOLMAP, DensifyPointCloud and ReconstructMesh of OpenMVS");
    if (unread)
        snprintf(hint, sizeof hint, "convert it with Blender or MeshLab, keeping its coordinates");
    tell(f, unread ? unread : "mesh.ply", reason, hint);
    mem_free(gaussians);
}
