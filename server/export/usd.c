/* usd.c -- see usd.h. The syntax is that of OpenUSD's text files; the schemas are UsdGeom, UsdShade and UsdLux, and the
 * specification of UsdPreviewSurface. */
#include "server/export/usd.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "common/protocol.h"
#include "server/export/emission_texture.h"
#include "server/export/sink.h"
#include "server/export/upright.h"

#define CAMERAS_MAX 100 /* of held-out views */
#define APERTURE 0.36   /* width of a film of 36 mm, in tenths of the unit, the metre */
#define NEAR_M 0.01     /* metres: nearer than any photograph is taken */
#define FAR_M 1000.0    /* clipping range of cameras, with NEAR_M */
#define VALUES_A_LINE 8 /* of arrays */
#define TRIPLE "(" SINK_FLOAT ", " SINK_FLOAT ", " SINK_FLOAT ")"

static void put_separator(struct sink *out, size_t i, size_t count) {
    if (i + 1 < count)
        sink_printf(out, (i + 1) % VALUES_A_LINE == 0 ? ",\n" : ", ");
}

/* In quotation marks, on one line. */
static void put_string(struct sink *out, const char *text) {
    sink_printf(out, "\"");
    for (; *text; text++) {
        char c = (unsigned char)*text < ' ' || *text == 0x7f ? ' ' : *text;
        if (c == '"' || c == '\\')
            sink_printf(out, "\\");
        sink_bytes(out, &c, 1);
    }
    sink_printf(out, "\"");
}

/* parts_label with _ for what names of prims may not have: -, and for older readers all beyond ASCII. */
static void prim_name(const struct export_input *in, uint32_t segment, char label[PARTS_LABEL_BYTES]) {
    parts_label(in->segments, in->mesh, segment, label);
    for (char *c = label; *c; c++)
        *c = *c == '-' || (unsigned char)*c >= 0x80 ? '_' : *c;
    for (size_t length = strlen(label); label[length - 1] == '_'; length--)
        label[length - 1] = '\0';
}

/* Among a prim's metadata: what the input calls it; NULL: nothing. */
static void put_display_name(struct sink *out, const char *name) {
    if (!name)
        return;
    sink_printf(out, "            displayName = ");
    put_string(out, name);
    sink_printf(out, "\n");
}

/* --- meshes ------------------------------------------------------------------------------------ */

static void put_vectors(struct sink *out, const struct export_input *in, const struct seams *seams,
                        const struct part *part, vec3 (*get)(const struct seams *, const struct mesh *, size_t)) {
    sink_printf(out, "[");
    for (size_t i = 0; i < part->vertex_count; i++) {
        vec3 v = get(seams, in->mesh, part->first_vertex + i);
        sink_printf(out, TRIPLE, (double)v.x, (double)v.y, (double)v.z);
        put_separator(out, i, part->vertex_count);
    }
    sink_printf(out, "]");
}

static void put_faces(struct sink *out, const struct parts *parts, const struct part *part) {
    sink_printf(out, "            int[] faceVertexCounts = [");
    for (size_t i = 0; i < part->triangle_count; i++) {
        sink_printf(out, "3");
        put_separator(out, i, part->triangle_count);
    }
    sink_printf(out, "]\n            int[] faceVertexIndices = [");
    for (size_t i = 0; i < 3 * part->triangle_count; i++) {
        uint32_t triangle = parts->order[part->first_triangle + i / 3];
        sink_printf(out, "%u", parts->seams.index[triangle][i % 3] - (uint32_t)part->first_vertex);
        put_separator(out, i, 3 * part->triangle_count);
    }
    sink_printf(out, "]\n");
}

static void put_input_uv(struct sink *out, const struct export_input *in, const struct parts *parts,
                         const struct part *part) {
    sink_printf(out, "            texCoord2f[] primvars:st1 = [");
    for (size_t i = 0; i < part->vertex_count; i++) {
        vec2 uv = seams_input_uv(&parts->seams, in->mesh, part->first_vertex + i);
        sink_printf(out, "(" SINK_FLOAT ", " SINK_FLOAT ")", (double)uv.x, (double)uv.y);
        put_separator(out, i, part->vertex_count);
    }
    sink_printf(out, "] (\n                interpolation = \"vertex\"\n            )\n");
}

static void put_mesh(struct sink *out, const struct export_input *in, const struct parts *parts,
                     const struct part *part) {
    bool emits = !rgb_is_black(in->materials->emission[part->segment]);
    const char *own = segments_name(in->segments, in->mesh, part->segment);
    char name[PARTS_LABEL_BYTES];
    prim_name(in, part->segment, name);
    sink_printf(out,
                "        def Mesh \"%s\" (\n"
                "            prepend apiSchemas = [\"MaterialBindingAPI\"%s]\n"
                "            customData = {\n"
                "                int segment = %u\n"
                "                int64 object_id = %lld\n"
                "            }\n",
                name, emits ? ", \"MeshLightAPI\"" : "", part->segment, (long long)in->segments->id[part->segment]);
    put_display_name(out, own);
    sink_printf(out,
                "        )\n        {\n"
                "            uniform token subdivisionScheme = \"none\"\n"
                "            uniform bool doubleSided = %d\n"
                "            float3[] extent = [" TRIPLE ", " TRIPLE "]\n"
                "            rel material:binding = </Room/Materials/%s>\n",
                !emits, (double)part->lower.x, (double)part->lower.y, (double)part->lower.z, (double)part->upper.x,
                (double)part->upper.y, (double)part->upper.z, name);
    if (emits)
        sink_printf(out, "            uniform token light:materialSyncMode = \"materialGlowTintsLight\"\n"
                         "            float inputs:intensity = 1\n");
    put_faces(out, parts, part);
    sink_printf(out, "            point3f[] points = ");
    put_vectors(out, in, &parts->seams, part, seams_position);
    if (in->mesh->normal) {
        sink_printf(out, "\n            normal3f[] normals = ");
        put_vectors(out, in, &parts->seams, part, seams_normal);
        sink_printf(out, " (\n                interpolation = \"vertex\"\n            )");
    }
    sink_printf(out, "\n            texCoord2f[] primvars:st = [");
    for (size_t i = 0; i < part->vertex_count; i++) {
        vec2 uv = seams_uv(&parts->seams, in->atlas, part->first_vertex + i);
        sink_printf(out, "(" SINK_FLOAT ", " SINK_FLOAT ")", (double)uv.x, (double)(1.0f - uv.y));
        put_separator(out, i, part->vertex_count);
    }
    sink_printf(out, "] (\n                interpolation = \"vertex\"\n            )\n");
    if (in->mesh->uv)
        put_input_uv(out, in, parts, part);
    sink_printf(out, "        }\n");
}

/* What radiance is multiplied by: lights are in nits where their luminance is known (UsdLux: intensity 1 is 1 nit). */
static double unit_of(const struct export_input *in) {
    return in->luminance_per_unit > 0.0 ? in->luminance_per_unit : 1.0;
}

/* --- materials --------------------------------------------------------------------------------- */

static void put_texture(struct sink *out, const char *material, const char *shader, const char *file, double scale) {
    sink_printf(out,
                "            def Shader \"%s\"\n            {\n"
                "                uniform token info:id = \"UsdUVTexture\"\n"
                "                asset inputs:file = @./%s@\n"
                "                token inputs:sourceColorSpace = \"sRGB\"\n"
                "                float4 inputs:scale = (" SINK_FLOAT ", " SINK_FLOAT ", " SINK_FLOAT ", 1)\n"
                "                float2 inputs:st.connect = </Room/Materials/%s/st.outputs:result>\n"
                "                token inputs:wrapS = \"clamp\"\n"
                "                token inputs:wrapT = \"clamp\"\n"
                "                float3 outputs:rgb\n"
                "            }\n",
                shader, file, scale, scale, scale, material);
}

static void put_emission(struct sink *out, const char *material, rgb emission, bool varies) {
    if (varies)
        sink_printf(
            out, "                color3f inputs:emissiveColor.connect = </Room/Materials/%s/emission.outputs:rgb>\n",
            material);
    else if (!rgb_is_black(emission))
        sink_printf(out, "                color3f inputs:emissiveColor = " TRIPLE "\n", (double)emission.r,
                    (double)emission.g, (double)emission.b);
}

/* `scale` of the emission's pattern; 0: it has none. */
static void put_material(struct sink *out, const struct export_input *in, uint32_t segment, double scale,
                         const struct usd_textures *textures) {
    const struct materials *m = in->materials;
    double root = sqrt(0.08 * (double)m->specular[segment]);
    char name[PARTS_LABEL_BYTES];
    prim_name(in, segment, name);
    sink_printf(out, "        def Material \"%s\" (\n", name);
    put_display_name(out, segments_name(in->segments, in->mesh, segment));
    sink_printf(out,
                "        )\n        {\n"
                "            token outputs:surface.connect = </Room/Materials/%s/surface.outputs:surface>\n"
                "            def Shader \"surface\"\n            {\n"
                "                uniform token info:id = \"UsdPreviewSurface\"\n"
                "                color3f inputs:diffuseColor.connect = </Room/Materials/%s/base_color.outputs:rgb>\n"
                "                int inputs:useSpecularWorkflow = 0\n"
                "                float inputs:metallic = 0\n"
                "                float inputs:roughness = " SINK_FLOAT "\n"
                "                float inputs:ior = " SINK_FLOAT "\n",
                name, name, (double)m->roughness[segment], (1.0 + root) / (1.0 - root));
    put_emission(out, name, rgb_scale(m->emission[segment], (float)unit_of(in)), scale > 0.0);
    sink_printf(out, "                token outputs:surface\n            }\n");
    put_texture(out, name, "base_color", textures->base_color, 1.0);
    if (scale > 0.0)
        put_texture(out, name, "emission", textures->emission, scale * unit_of(in));
    sink_printf(out, "            def Shader \"st\"\n            {\n"
                     "                uniform token info:id = \"UsdPrimvarReader_float2\"\n"
                     "                string inputs:varname = \"st\"\n"
                     "                float2 outputs:result\n"
                     "            }\n        }\n");
}

/* --- lights and cameras ------------------------------------------------------------------------ */

/* The rows of a matrix are where the axes go: USD's vectors are rows. */
static void put_matrix(struct sink *out, const char *indent, double axis[3][3], const double at[3]) {
    sink_printf(out, "%smatrix4d xformOp:transform = (", indent);
    for (int i = 0; i < 3; i++)
        sink_printf(out, " (%.17g, %.17g, %.17g, 0),", axis[i][0], axis[i][1], axis[i][2]);
    sink_printf(out, " (%.17g, %.17g, %.17g, 1) )\n%suniform token[] xformOpOrder = [\"xformOp:transform\"]\n", at[0],
                at[1], at[2], indent);
}

/* It shines along -z, with an irradiance of intensity times colour where it is normalized. */
static void put_sun(struct sink *out, const struct export_sun *sun, double unit) {
    vec3 across, up;
    float most = rgb_max(sun->irradiance);
    rgb color = rgb_scale(sun->irradiance, 1.0f / most);
    vec3_frame(sun->direction, &across, &up);
    double axis[3][3] = {{(double)across.x, (double)across.y, (double)across.z},
                         {(double)up.x, (double)up.y, (double)up.z},
                         {(double)sun->direction.x, (double)sun->direction.y, (double)sun->direction.z}};
    sink_printf(out,
                "        def DistantLight \"Sun\"\n        {\n"
                "            float inputs:angle = " SINK_FLOAT "\n"
                "            color3f inputs:color = " TRIPLE "\n"
                "            float inputs:intensity = " SINK_FLOAT "\n"
                "            bool inputs:normalize = 1\n",
                2.0 * (double)sun->radius_rad * 180.0 / PI, (double)color.r, (double)color.g, (double)color.b,
                (double)most * unit);
    put_matrix(out, "            ", axis, (const double[3]){0.0, 0.0, 0.0});
    sink_printf(out, "        }\n");
}

static void put_lights(struct sink *out, const struct export_input *in, const struct usd_textures *textures) {
    if (!in->environment)
        return;
    sink_printf(out,
                "    def Xform \"Lights\"\n    {\n"
                "        def DomeLight \"Sky\"\n        {\n"
                "            float inputs:intensity = " SINK_FLOAT "\n"
                "            asset inputs:texture:file = @./%s@\n"
                "            token inputs:texture:format = \"latlong\"\n"
                "        }\n",
                unit_of(in), textures->sky);
    if (in->sun.is_there && rgb_max(in->sun.irradiance) > 0.0f)
        put_sun(out, &in->sun, unit_of(in));
    sink_printf(out, "    }\n");
}

/* Our camera: x right, y down, z forward; USD's: x right, y up, z back. */
static void put_camera(struct sink *out, size_t number, const struct export_comparison *view) {
    const struct camera *c = view->camera;
    const float(*r)[3] = c->world_from_camera.rotation;
    vec3 at = c->world_from_camera.translation;
    double axis[3][3], width = (double)c->width, height = (double)c->height, fx = (double)c->fx, fy = (double)c->fy;
    double focal = APERTURE * fx / width;
    for (int i = 0; i < 3; i++) {
        axis[0][i] = (double)r[i][0];
        axis[1][i] = -(double)r[i][1];
        axis[2][i] = -(double)r[i][2];
    }
    sink_printf(out, "        def Camera \"view_%zu\" (\n            displayName = ", number);
    put_string(out, view->name);
    sink_printf(out,
                "\n        )\n        {\n"
                "            token projection = \"perspective\"\n"
                "            float focalLength = " SINK_FLOAT "\n"
                "            float horizontalAperture = " SINK_FLOAT "\n"
                "            float verticalAperture = " SINK_FLOAT "\n"
                "            float horizontalApertureOffset = " SINK_FLOAT "\n"
                "            float verticalApertureOffset = " SINK_FLOAT "\n"
                "            float2 clippingRange = (" SINK_FLOAT ", " SINK_FLOAT ")\n",
                focal, APERTURE, focal * height / fy, focal * (0.5 * width - (double)c->cx) / fx,
                focal * ((double)c->cy - 0.5 * height) / fy, NEAR_M, FAR_M);
    put_matrix(out, "            ", axis, (const double[3]){(double)at.x, (double)at.y, (double)at.z});
    sink_printf(out, "        }\n");
}

static void put_cameras(struct sink *out, const struct export_input *in) {
    sink_printf(out, "    def Xform \"Cameras\"\n    {\n");
    for (size_t i = 0; i < in->comparison_count && i < CAMERAS_MAX; i++)
        if (in->comparison[i].camera->model == CAMERA_OPENCV)
            put_camera(out, i, &in->comparison[i]);
    sink_printf(out, "    }\n");
}

/* --- the layer --------------------------------------------------------------------------------- */

static void put_head(struct sink *out, const struct export_input *in) {
    double axis[3][3], at[3];
    for (int i = 0; i < 3; i++)
        upright_turn(in->up, (const double[3]){i == 0, i == 1, i == 2}, axis[i]);
    upright_turn(in->up, in->mesh->offset, at);
    sink_printf(out,
                "#usda 1.0\n(\n"
                "    customLayerData = {\n"
                "        string creator = \"unbake " UNBAKE_VERSION "\"\n"
                "        string radianceUnit = \"%s\"\n"
                "        int cleanMipLevel = %d\n"
                "        double atlasUtilisation = %.6g\n"
                "    }\n"
                "    defaultPrim = \"Room\"\n"
                "    metersPerUnit = 1\n"
                "    upAxis = \"Y\"\n"
                ")\n\n"
                "def Xform \"Room\" (\n    kind = \"component\"\n    displayName = ",
                in->luminance_per_unit > 0.0
                    ? "nits"
                    : "relative, not nits: a photograph of exposure 1 shows radiance 1 as pixel value 1",
                atlas_clean_level(in->atlas->padding), in->atlas->utilisation);
    put_string(out, in->title);
    sink_printf(out, "\n)\n{\n");
    put_matrix(out, "    ", axis, at);
}

enum status usd_write(const char *path, const struct export_input *in, const struct parts *parts,
                      const struct usd_textures *textures, struct error *err) {
    struct sink out;
    enum status status = sink_open(&out, path, 0, err);
    if (status != STATUS_OK)
        return status;
    float *scales = emission_texture_scales(in);
    put_head(&out, in);
    sink_printf(&out, "    def Xform \"Segments\"\n    {\n");
    for (size_t p = 0; p < parts->count; p++)
        put_mesh(&out, in, parts, &parts->part[p]);
    sink_printf(&out, "    }\n    def Scope \"Materials\"\n    {\n");
    for (size_t p = 0; p < parts->count; p++) {
        uint32_t segment = parts->part[p].segment;
        put_material(&out, in, segment, scales ? (double)scales[segment] : 0.0, textures);
    }
    sink_printf(&out, "    }\n");
    put_lights(&out, in, textures);
    put_cameras(&out, in);
    sink_printf(&out, "}\n");
    mem_free(scales);
    return sink_close(&out, STATUS_OK, err);
}
