/* render_settings_table.c -- the table of render_settings.h, and what is made of it. */
#include <stdlib.h>
#include <string.h>

#include "common/choices.h"
#include "common/nearest.h"
#include "common/render_settings.h"

static const struct render_setting table[] = {
    {"attach.#", RENDER_FILE, "", 0, 0, 0, NULL, "",
     "a further file that an inserted mesh names: the .mtl of an .obj, a picture; a .glb has all in it"},
    {"cameras", RENDER_FILE, "", 0, 0, 0, "held_out|photographs", "held_out",
     "where to render from: the held-out views, the cameras of all photographs, or those of a transforms.json with w and h"},
    {"date", RENDER_DATE, "", 0, 0, 0, NULL, "", "environment=sky: the day, as 2024-06-21"},
    {"denoise", RENDER_BOOL, "", 0, 0, 0, NULL, "false",
     "take the noise out of pictures with Open Image Denoise, guided by base colour and normals, where its library is "
     "installed; the files say so"},
    {"environment", RENDER_FILE, "", 0, 0, 0, "found|none|sky", "found",
     "distant light: that of the reconstruction, none, sun and sky by Preetham's model, or a latitude-longitude map "
     "(.hdr, .exr, .png)"},
    {"environment_scale", RENDER_REAL, "", 0, 1e9, 0, NULL, "1", "factor on the radiance of distant light"},
    {"environment_turn", RENDER_REAL, "degrees", -360, 360, 0, NULL, "0",
     "turns a map, or what was found, around the upward axis, counter-clockwise from above"},
    {"executor", RENDER_TEXT, "", 0, 0, 0, NULL, "",
     "jobs: where parts are rendered: the name of an executor that the daemon's administrator has set up; empty: where "
     "there is a place"},
    {"exposure", RENDER_REAL, "", 0, 1e9, 0, NULL, "0",
     "factor on radiance in PNGs; 0: one for all, chosen by the first view"},
    {"format", RENDER_CHOICE, "", 0, 0, 0, "png|exr|both", "png",
     "files of pictures; depth, position and segment are EXR always"},
    {"insert.#.base_color", RENDER_NUMBERS, "", 0, 1, 3, NULL, "0.5, 0.5, 0.5",
     "base colour of an inserted mesh, in place of what its file says"},
    {"insert.#.emission", RENDER_NUMBERS, "", 0, 1e9, 3, NULL, "0, 0, 0",
     "radiance that an inserted mesh emits, in place of what its file says"},
    {"insert.#.emission_scale", RENDER_REAL, "", 0, 1e9, 0, NULL, "1",
     "factor on what an inserted mesh emits; emissive colours of files are radiance"},
    {"insert.#.file", RENDER_FILE, "", 0, 0, 0, NULL, "",
     "a mesh that is put into the room, its y upwards: .glb or .gltf with its materials and pictures, .obj with those of its "
     ".mtl, .ply"},
    {"insert.#.metallic", RENDER_REAL, "", 0, 1, 0, NULL, "0",
     "share of an inserted mesh that is metal, in place of what its file says"},
    {"insert.#.position", RENDER_NUMBERS, "m", -1e6, 1e6, 3, NULL, "0, 0, 0",
     "where the origin of an inserted mesh goes, in the room's coordinates"},
    {"insert.#.roughness", RENDER_REAL, "", 0, 1, 0, NULL, "0.5",
     "roughness of an inserted mesh, in place of what its file says"},
    {"insert.#.scale", RENDER_REAL, "", 1e-6, 1e6, 0, NULL, "1", "factor on the size of an inserted mesh"},
    {"insert.#.specular", RENDER_REAL, "", 0, 1, 0, NULL, "0.5",
     "specular of an inserted mesh, in place of what its file says"},
    {"insert.#.turn", RENDER_REAL, "degrees", -360, 360, 0, NULL, "0",
     "turns an inserted mesh around the upward axis, counter-clockwise from above"},
    {"lamp.#.angle", RENDER_REAL, "degrees", 1, 160, 0, NULL, "60", "full angle of a spot's cone"},
    {"lamp.#.blend", RENDER_REAL, "", 0, 1, 0, NULL, "0.2", "share of a spot's cone over which it fades"},
    {"lamp.#.direction", RENDER_NUMBERS, "", -1e6, 1e6, 3, NULL, "", "where an area or a spot shines"},
    {"lamp.#.kind", RENDER_CHOICE, "", 0, 0, 0, "area|sphere|spot", "",
     "adds a lamp: a rectangle that shines to one side, a ball, or a disc that shines into a cone"},
    {"lamp.#.lumen", RENDER_REAL, "lm", 0, 1e12, 0, NULL, "0",
     "luminous flux, in place of the brightness of radiance, which then gives the colour; luminance_per_unit is known then"},
    {"lamp.#.position", RENDER_NUMBERS, "m", -1e6, 1e6, 3, NULL, "", "centre of a lamp, in the room's coordinates"},
    {"lamp.#.radiance", RENDER_NUMBERS, "", 0, 1e12, 3, NULL, "10, 10, 10",
     "what a lamp emits in red, green and blue; of a spot along its axis"},
    {"lamp.#.radius", RENDER_REAL, "m", 1e-4, 1e4, 0, NULL, "0.05", "of a ball, or of a spot's disc"},
    {"lamp.#.size", RENDER_NUMBERS, "m", 1e-4, 1e4, 2, NULL, "0.5, 0.5", "width and height of an area"},
    {"latitude", RENDER_REAL, "degrees", -90, 90, 0, NULL, "", "environment=sky: north of the equator"},
    {"light.#", RENDER_FACTOR, "", 0, 1e9, 0, NULL, "on",
     "emission of a segment: on, off, a factor, or factors on red, green and blue"},
    {"lights", RENDER_CHOICE, "", 0, 0, 0, "on|off", "on",
     "whether the room's emitters shine; light.27 says otherwise of one"},
    {"longitude", RENDER_REAL, "degrees", -180, 180, 0, NULL, "", "environment=sky: east of Greenwich"},
    {"look_in", RENDER_BOOL, "", 0, 0, 0, NULL, "false",
     "the backs of surfaces are not shown, so that a camera outside looks into the room; light does not pass them"},
    {"luminance_per_unit", RENDER_REAL, "cd/m2", 0, 1e9, 0, NULL, "0",
     "luminance of radiance 1, which makes light absolute; 0: what the reconstruction's report says, where it knows"},
    {"max_depth", RENDER_INT, "segments", 1, 32, 0, NULL, "16", "longest path from the camera"},
    {"multilayer", RENDER_BOOL, "", 0, 0, 0, NULL, "false", "one EXR with all passes for each picture"},
    {"noise", RENDER_REAL, "", 1e-4, 1, 0, NULL, "0",
     "render until the standard error of a picture is this share of its mean; 0: spp samples"},
    {"north", RENDER_REAL, "degrees", -360, 360, 0, NULL, "0",
     "environment=sky: where north is, clockwise from above, from -z where y or x is up, from +y where z is"},
    {"panorama", RENDER_BOOL, "", 0, 0, 0, NULL, "false",
     "the whole sphere around each camera, equirectangular and level"},
    {"parts", RENDER_INT, "parts", 0, 1000, 0, NULL, "0",
     "jobs: in how many parts the pictures are rendered, at once where there are places; 0: as many as the daemon finds "
     "good; a small render is in one always, and the pictures are the same"},
    {"passes", RENDER_LIST, "", 0, 0, 0,
     "radiance|base_color|roughness|specular|emission|normal|depth|position|segment|direct|indirect", "radiance",
     "what is rendered of each view"},
    {"path", RENDER_TEXT, "", 0, 0, 0, NULL, "",
     "a smooth path through these views, as 0,3,7, in place of view; path_count pictures"},
    {"path_count", RENDER_INT, "pictures", 2, 100000, 0, NULL, "60", "pictures along the path"},
    {"per_light", RENDER_BOOL, "", 0, 0, 0, NULL, "false",
     "radiance of each source alone, too, as EXR: their sum is the whole"},
    {"precision", RENDER_CHOICE, "", 0, 0, 0, "half|float", "float",
     "of light, colours and normals in EXR: half takes half the space, with three digits and light up to 65504"},
    {"remove", RENDER_TEXT, "", 0, 0, 0, NULL, "",
     "segments that are taken away, as numbers or names: 27,window; opening: what stands around a scan for what it lacks, and "
     "keeps another sky out"},
    {"seed", RENDER_INT, "", 0, 9007199254740991.0, 0, NULL, "7", "names the random numbers"},
    {"segment.#.base_color", RENDER_NUMBERS, "", 0, 1, 3, NULL, "", "gives a segment another base colour"},
    {"segment.#.emission", RENDER_NUMBERS, "", 0, 1e9, 3, NULL, "", "gives a segment another emission, as radiance"},
    {"segment.#.roughness", RENDER_REAL, "", 0, 1, 0, NULL, "", "gives a segment another roughness"},
    {"segment.#.specular", RENDER_REAL, "", 0, 1, 0, NULL, "", "gives a segment another specular"},
    {"size", RENDER_SIZE, "pixels", 1, RENDER_MAX_SIDE, 0, NULL, "", "of pictures, as 640x480; else as the camera's"},
    {"sky", RENDER_FACTOR, "", 0, 1e9, 0, NULL, "on",
     "distant light without its sun: on, off, a factor, or factors on red, green and blue"},
    {"spp", RENDER_INT, "paths", 1, 1048576, 0, NULL, "64",
     "paths for each pixel; with noise or time_limit: at most (65536 where it is not given)"},
    {"sun", RENDER_FACTOR, "", 0, 1e9, 0, NULL, "on",
     "the sun of environment=sky, or the one that the reconstruction has found: on, off, a factor, or factors on red, "
     "green and blue"},
    {"suns", RENDER_INT, "", 1, 1440, 0, NULL, "1",
     "environment=sky: from 2 on, each view is rendered under so many suns, evenly from sunrise to sunset"},
    {"time", RENDER_CLOCK, "", 0, 0, 0, NULL, "12:00", "environment=sky: the time of day, in the zone of utc_offset"},
    {"time_limit", RENDER_REAL, "s", 0, 86400, 0, NULL, "0", "most time for each picture; 0: no limit"},
    {"turbidity", RENDER_REAL, "", 1.7, 10, 0, NULL, "3", "environment=sky: haze, from 2 (very clear) to 10"},
    {"unit", RENDER_CHOICE, "", 0, 0, 0, "radiance|nits", "radiance",
     "of light in EXR: radiance as of the reconstruction, or cd/m2, which needs luminance_per_unit"},
    {"up", RENDER_CHOICE, "", 0, 0, 0, "auto|x|y|z", "auto",
     "the room's axis that is up; auto: as most cameras are held"},
    {"utc_offset", RENDER_REAL, "hours", -12, 14, 0, NULL, "",
     "environment=sky: of the clock; else by longitude, a zone for each 15 degrees"},
    {"view", RENDER_TEXT, "", 0, 0, 0, NULL, "0",
     "which of the cameras: numbers in the file, from 0, or names of their pictures, separated by commas; or all"},
    {"view_transform", RENDER_CHOICE, "", 0, 0, 0, "srgb|filmic", "srgb",
     "from radiance to PNG: sRGB, which clips, or a filmic curve (Narkowicz 2015, fitted to ACES)"},
};
#define TABLE_COUNT (sizeof table / sizeof *table)

const struct render_setting *render_settings_table(size_t *count) {
    *count = TABLE_COUNT;
    return table;
}

/* Whether `name` is `pattern` with a number of up to nine digits, without leading zeros, in place of its #. */
static bool matches(const char *pattern, const char *name, uint32_t *number) {
    *number = UINT32_MAX;
    while (*pattern && *pattern != '#' && *pattern == *name) {
        pattern++;
        name++;
    }
    if (*pattern != '#')
        return *pattern == *name;
    size_t digits = strspn(name, "0123456789");
    if (digits == 0 || digits > 9 || (digits > 1 && *name == '0'))
        return false;
    *number = (uint32_t)strtoul(name, NULL, 10);
    return strcmp(pattern + 1, name + digits) == 0;
}

const struct render_setting *render_settings_find(const char *name, uint32_t *number) {
    uint32_t found;
    for (size_t i = 0; i < TABLE_COUNT; i++) {
        if (!matches(table[i].name, name, &found))
            continue;
        if (number)
            *number = found;
        return &table[i];
    }
    return NULL;
}

const char *render_settings_nearest(const char *name) {
    struct nearest nearest;
    nearest_init(&nearest, name);
    for (size_t i = 0; i < TABLE_COUNT; i++)
        nearest_offer(&nearest, table[i].name);
    return nearest.best;
}

static bool has_range(const struct render_setting *t) {
    return t->type == RENDER_INT || t->type == RENDER_REAL || t->type == RENDER_NUMBERS || t->type == RENDER_FACTOR ||
           t->type == RENDER_SIZE;
}

cJSON *render_settings_describe(void) {
    static const char *const type[] = {"int",     "real",   "bool", "choice", "text",  "list",
                                       "numbers", "factor", "size", "date",   "clock", "file"};
    cJSON *list = cJSON_CreateArray();
    for (size_t i = 0; i < TABLE_COUNT; i++) {
        const struct render_setting *t = &table[i];
        cJSON *entry = cJSON_CreateObject();
        json_add_string(entry, "name", t->name);
        json_add_string(entry, "type", type[t->type]);
        json_add_string(entry, "unit", t->unit);
        if (has_range(t)) {
            json_add_number(entry, "minimum", t->minimum);
            json_add_number(entry, "maximum", t->maximum);
        }
        if (t->count > 0)
            json_add_int(entry, "count", (int64_t)t->count);
        choices_to_json(t->choices, entry);
        json_add_string(entry, "default", t->default_text);
        json_add_string(entry, "help", t->help);
        cJSON_AddItemToArray(list, entry);
    }
    return list;
}
