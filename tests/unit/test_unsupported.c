/* test_unsupported.c -- bundles that cannot be used as they are: each is told by name, with what makes it usable. */
#include "server/ingest/source/unsupported.h"

#include "tests/unit/source_rig.h"

#define FILES 8
#define PHOTOGRAPHS "images/0.jpg", "images/1.jpg", "images/2.jpg"

/* Content of a file: after the first blank of its name, else nothing. */
static const struct told {
    const char *file[FILES], *named, *reason, *hint;
} rows[] = {
    {{PHOTOGRAPHS}, "images/0.jpg", "only photographs", "colmap automatic_reconstructor"},
    {{"walk.MOV"}, "walk.MOV", "a video", "ffmpeg"},
    {{"VID_1.insv", "images/0.jpg"}, "VID_1.insv", "a video", "ffmpeg"},
    {{PHOTOGRAPHS, "room.obj"}, "images/0.jpg", "photographs and a mesh, but no poses", "RealityCapture CSV or XMP"},
    {{PHOTOGRAPHS, "room.obj", "images/0.xmp <x:xmpmeta><rdf:RDF/></x:xmpmeta>"}, "images/0.jpg", "no poses", "XMP"},
    {{"point_cloud/iteration_7/point_cloud.ply"}, "point_cloud/iteration_7/point_cloud.ply", "3D Gaussians", "sparse/"},
    {{"scan.ply ply\nproperty float f_dc_0\nproperty float opacity\n"}, "scan.ply", "3D Gaussians", "images/"},
    {{"in/scan.ply ply\nproperty float f_dc_0\nproperty float opacity\n", PHOTOGRAPHS},
     "in/scan.ply",
     "3D Gaussians",
     ""},
    {{"scene.splat"}, "scene.splat", "3D Gaussians", "sparse/"},
    {{"rgb.mp4", "odometry.csv", "camera_matrix.csv", "depth/0.png"}, "odometry.csv", "Stray Scanner", "ffmpeg"},
    {{"scene0000_00.sens", "scene0000_00_vh_clean_2.ply"}, "scene0000_00.sens", ".sens", "reader.py"},
    {{"habitat/mesh_semantic.ply", "mesh.ply", "textures/0.hdr"},
     "habitat/mesh_semantic.ply",
     "Replica",
     "ReplicaRenderer"},
    {{"h.obj", "h.e57"}, "h.e57", "MatterPak", "raw data"},
    {{"scan.laz"}, "scan.laz", "laser scanner", "colmap"},
    {{"room.usdz", PHOTOGRAPHS}, "room.usdz", "RoomPlan", "Developer mode"},
    {{"3DModel.glb"}, "3DModel.glb", "Luma, KIRI", "raw data"},
    {{"room.blend"}, "room.blend", ".blend", "BlenderNeRF"},
    {{"sfm.abc", PHOTOGRAPHS}, "sfm.abc", "Alembic", "cameras.sfm"},
    {{"a.CR2", "b.NEF", "c.dng"}, "a.CR2", "camera raw", "16-bit linear TIFF"},
    {{"room.psx", PHOTOGRAPHS, "room.obj"}, "room.psx", "project of Metashape's", "Export Cameras"},
    {{"room.rcproj", PHOTOGRAPHS, "room.obj"}, "room.rcproj", "project of RealityCapture's", "CSV"},
    {{"room.mg", PHOTOGRAPHS}, "room.mg", "Meshroom's project", "StructureFromMotion"},
    {{"room.nvm", PHOTOGRAPHS}, "room.nvm", "VisualSFM", "bundle.rd.out"},
    {{"database.db", PHOTOGRAPHS}, "database.db", "COLMAP's database", "colmap mapper"},
    {{"cameras.json {\"frames\":[{\"transform_matrix\":0}]}", PHOTOGRAPHS},
     "cameras.json",
     "by its looks",
     "transforms="},
    {{"readme.txt"}, "transforms.json", "no transforms.json", "list of sources"},
};

static void check_row(const struct told *row) {
    struct source_rig rig;
    struct findings f = {.problems = cJSON_CreateArray()};
    source_rig_start(&rig, "");
    for (size_t i = 0; i < FILES && row->file[i]; i++) {
        size_t length = strcspn(row->file[i], " ");
        char *path = mem_strndup(row->file[i], length);
        source_rig_put(&rig, path, row->file[i] + length + (row->file[i][length] == ' '));
        mem_free(path);
    }
    listing_of_memory(&rig.listing, rig.file, rig.count);
    struct source_match match = sources_find(&rig.listing, NULL);
    CHECK_THAT(!match.source, "%s is taken for %s", row->file[0], match.source ? match.source->name : "");
    source_match_release(&match);
    unsupported_tell_cameras(&rig.listing, NULL, &f);
    const cJSON *problem = cJSON_GetArrayItem(f.problems, 0);
    char *text = json_text(problem);
    CHECK(cJSON_GetArraySize(f.problems) == 1);
    const char *file = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(problem, "file"));
    CHECK_THAT(strcmp(file ? file : "", row->named) == 0 && strstr(text, row->reason) && strstr(text, row->hint),
               "%s: %s", row->file[0], text);
    mem_free(text);
    cJSON_Delete(f.problems);
    findings_release(&f);
    source_rig_stop(&rig);
}

int main(void) {
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        check_row(&rows[i]);
    return check_result();
}
