/* formats.c -- see formats.h. */
#include "server/export/formats.h"

#include "common/file.h"
#include "common/mem.h"
#include "common/output_names.h"
#include "server/export/glb.h"
#include "server/export/mesh_obj.h"
#include "server/export/mitsuba.h"
#include "server/export/usd.h"

static enum status write_glb(const char *dir, const struct export_input *input, const struct parts *parts,
                             struct error *err) {
    bool own = glb_shown(input) != input;
    char *path = file_join(dir, "scene.glb");
    char *base_color = file_join(dir, own ? FORMATS_BAKED FORMATS_BASE_COLOR : FORMATS_BASE_COLOR);
    char *emission = file_join(dir, own ? FORMATS_BAKED FORMATS_EMISSION : FORMATS_EMISSION);
    enum status status = glb_write(path, input, parts, base_color, emission, err);
    mem_free(emission);
    mem_free(base_color);
    mem_free(path);
    return status;
}

static enum status write_obj(const char *dir, const struct export_input *input, const struct parts *parts,
                             struct error *err) {
    char *path = file_join(dir, "scene.obj");
    enum status status = mesh_obj_write(path, input, parts, err);
    mem_free(path);
    return status;
}

static enum status write_mtl(const char *dir, const struct export_input *input, const struct parts *parts,
                             struct error *err) {
    char *path = file_join(dir, "scene.mtl");
    enum status status = mesh_mtl_write(path, input, parts, FORMATS_BASE_COLOR, FORMATS_EMISSION, err);
    mem_free(path);
    return status;
}

static enum status write_xml(const char *dir, const struct export_input *input, const struct parts *parts,
                             struct error *err) {
    char *path = file_join(dir, "scene.xml");
    enum status status = mitsuba_xml_write(path, input, parts, "scene.serialized", err);
    mem_free(path);
    return status;
}

static enum status write_shapes(const char *dir, const struct export_input *input, const struct parts *parts,
                                struct error *err) {
    char *path = file_join(dir, "scene.serialized");
    enum status status = mitsuba_shapes_write(path, input, parts, err);
    mem_free(path);
    return status;
}

/* The map without a sun that is a light of its own. */
static const char *sky_of(const struct export_input *input) {
    return input->sun.is_there ? OUTPUT_SKY : OUTPUT_ENVIRONMENT;
}

static enum status write_usda(const char *dir, const struct export_input *input, const struct parts *parts,
                              struct error *err) {
    const struct usd_textures textures = {FORMATS_BASE_COLOR, FORMATS_EMISSION, sky_of(input)};
    char *path = file_join(dir, FORMATS_USD_LAYER);
    enum status status = usd_write(path, input, parts, &textures, err);
    mem_free(path);
    return status;
}

static enum status write_usdz(const char *dir, const struct export_input *input, const struct parts *parts,
                              struct error *err) {
    const char *name[4] = {FORMATS_USD_LAYER, FORMATS_BASE_COLOR};
    char *path = file_join(dir, "scene.usdz");
    size_t count = 2;
    (void)parts; /* they are in the layer */
    if (input->materials->emission_pattern)
        name[count++] = FORMATS_EMISSION;
    if (input->environment)
        name[count++] = sky_of(input);
    enum status status = usdz_write(path, dir, name, count, err);
    mem_free(path);
    return status;
}

const struct format formats[FORMATS_COUNT] = {
    {"scene.glb", "model/gltf-binary", "the room as glTF 2.0, for Blender and others", write_glb},
    {"scene.obj", "model/obj", "the mesh with its atlas coordinates", write_obj},
    {"scene.mtl", "model/mtl", "the materials of scene.obj; wants base_color.png and, where there is one, emission.png",
     write_mtl},
    {"scene.xml", "application/xml", "the room for Mitsuba 3; wants scene.serialized and the textures", write_xml},
    {"scene.serialized", "application/octet-stream", "the shapes of scene.xml", write_shapes},
    {FORMATS_USD_LAYER, "model/vnd.usda",
     "the room as OpenUSD, with lights and cameras; wants base_color.png and, where there are, emission.png and "
     "environment.exr or sky.exr",
     write_usda},
    {"scene.usdz", "model/vnd.usdz+zip", "scene.usda and its textures in one file", write_usdz},
};
