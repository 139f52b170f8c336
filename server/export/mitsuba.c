/* mitsuba.c -- see mitsuba.h. The layout of scene.serialized (version 4) is in the documentation of Mitsuba's plugin
 * `serialized`: per mesh a header and a zlib stream, then a table of their offsets. */
#include "server/export/mitsuba.h"

#include <endian.h>
#include <math.h>
#include <string.h>
#include <zlib.h>

#include "common/mem.h"
#include "server/export/emission_texture.h"
#include "server/export/sink.h"

#define SENSORS_MAX 100 /* held-out views in scene.xml */
#define SPP 64          /* samples a pixel that scene.xml asks for */
#define MAX_DEPTH 16    /* segments of a path, likewise */

/* --- scene.xml ------------------------------------------------------------------------------ */

/* Our camera: x right, y down, z forward; Mitsuba's: x left, y up, z forward. */
static void put_sensor(struct sink *out, size_t number, const struct camera *c) {
    const float(*r)[3] = c->world_from_camera.rotation;
    const vec3 at = c->world_from_camera.translation;
    const float origin[3] = {at.x, at.y, at.z};
    double width = (double)c->width, height = (double)c->height;
    sink_printf(out,
                "  <sensor type=\"perspective\" id=\"view_%zu\">\n"
                "    <transform name=\"to_world\"><matrix value=\"",
                number);
    for (int i = 0; i < 3; i++)
        sink_printf(out, SINK_FLOAT " " SINK_FLOAT " " SINK_FLOAT " " SINK_FLOAT " ", -(double)r[i][0],
                    -(double)r[i][1], (double)r[i][2], (double)origin[i]);
    sink_printf(out,
                "0 0 0 1\"/></transform>\n"
                "    <string name=\"fov_axis\" value=\"x\"/>\n"
                "    <float name=\"fov\" value=\"" SINK_FLOAT "\"/>\n"
                "    <float name=\"principal_point_offset_x\" value=\"" SINK_FLOAT "\"/>\n"
                "    <float name=\"principal_point_offset_y\" value=\"" SINK_FLOAT "\"/>\n"
                "    <float name=\"near_clip\" value=\"0.001\"/>\n"
                "    <film type=\"hdrfilm\">\n"
                "      <integer name=\"width\" value=\"%u\"/>\n"
                "      <integer name=\"height\" value=\"%u\"/>\n"
                "      <string name=\"pixel_format\" value=\"rgb\"/>\n"
                "      <string name=\"component_format\" value=\"float32\"/>\n"
                "      <rfilter type=\"box\"/>\n"
                "    </film>\n"
                "    <sampler type=\"independent\"><integer name=\"sample_count\" value=\"$spp\"/></sampler>\n"
                "  </sensor>\n",
                2.0 * atan(0.5 * width / (double)c->fx) * 180.0 / PI, (0.5 * width - (double)c->cx) / width,
                (0.5 * height - (double)c->cy) / height, c->width, c->height);
}

static void put_emitter(struct sink *out, rgb radiance, bool varies) {
    if (varies)
        sink_printf(out, "    <emitter type=\"area\"><ref name=\"radiance\" id=\"emission\"/></emitter>\n");
    else
        sink_printf(out,
                    "    <emitter type=\"area\"><rgb name=\"radiance\" value=\"" SINK_FLOAT " " SINK_FLOAT
                    " " SINK_FLOAT "\"/></emitter>\n",
                    (double)radiance.r, (double)radiance.g, (double)radiance.b);
}

static void put_shape(struct sink *out, const struct export_input *in, const char *shapes, size_t number,
                      uint32_t segment, bool varies) {
    const struct materials *m = in->materials;
    char label[PARTS_LABEL_BYTES];
    parts_label(in->segments, in->mesh, segment, label);
    sink_printf(out,
                "  <shape type=\"serialized\" id=\"%s\">\n"
                "    <string name=\"filename\" value=\"%s\"/>\n"
                "    <integer name=\"shape_index\" value=\"%zu\"/>\n"
                "    <boolean name=\"face_normals\" value=\"%s\"/>\n"
                "    <bsdf type=\"twosided\"><bsdf type=\"principled\">\n"
                "      <ref name=\"base_color\" id=\"base_color\"/>\n"
                "      <float name=\"roughness\" value=\"" SINK_FLOAT "\"/>\n"
                "      <float name=\"specular\" value=\"" SINK_FLOAT "\"/>\n"
                "    </bsdf></bsdf>\n",
                label, shapes, number, in->mesh->normal ? "false" : "true", (double)m->roughness[segment],
                (double)m->specular[segment]);
    if (rgb_max(m->emission[segment]) > 0.0f)
        put_emitter(out, m->emission[segment], varies);
    sink_printf(out, "  </shape>\n");
}

enum status mitsuba_xml_write(const char *path, const struct export_input *in, const struct parts *parts,
                              const char *shapes, struct error *err) {
    struct sink out;
    enum status status = sink_open(&out, path, UINT32_MAX, err);
    if (status != STATUS_OK)
        return status;
    sink_printf(&out,
                "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n"
                "<!-- For Mitsuba 3: mitsuba -m llvm_ad_rgb -s VIEW -D spp=256 scene.xml. Metres; radiance in\n"
                "     units in which a frame of exposure 1 maps radiance 1 to pixel value 1. -->\n"
                "<scene version=\"3.0.0\">\n"
                "  <default name=\"spp\" value=\"%d\"/>\n"
                "  <default name=\"max_depth\" value=\"%d\"/>\n"
                "  <integrator type=\"path\"><integer name=\"max_depth\" value=\"$max_depth\"/></integrator>\n",
                SPP, MAX_DEPTH);
    sink_offset(&out, "  <!--", in->mesh->offset, ": to be added to all coordinates for those of the input -->\n");
    for (size_t i = 0; i < in->comparison_count && i < SENSORS_MAX; i++)
        if (in->comparison[i].camera->model == CAMERA_OPENCV)
            put_sensor(&out, i, in->comparison[i].camera);
    sink_printf(&out, "  <texture type=\"bitmap\" id=\"base_color\">\n"
                      "    <string name=\"filename\" value=\"base_color.exr\"/>\n"
                      "    <string name=\"wrap_mode\" value=\"clamp\"/>\n"
                      "  </texture>\n");
    float *scales = emission_texture_scales(in);
    if (scales)
        sink_printf(&out, "  <texture type=\"bitmap\" id=\"emission\">\n"
                          "    <string name=\"filename\" value=\"emission.exr\"/>\n"
                          "    <string name=\"wrap_mode\" value=\"clamp\"/>\n"
                          "  </texture>\n");
    for (size_t p = 0; p < parts->count; p++)
        put_shape(&out, in, shapes, p, parts->part[p].segment, scales && scales[parts->part[p].segment] > 0.0f);
    mem_free(scales);
    if (in->environment)
        sink_printf(&out, "  <emitter type=\"envmap\"><string name=\"filename\" value=\"environment.exr\"/>"
                          "</emitter>\n");
    sink_printf(&out, "</scene>\n");
    return sink_close(&out, STATUS_OK, err);
}

/* --- scene.serialized ----------------------------------------------------------------------- */

#define FORMAT 0x041c /* of the header, as the next */
#define VERSION 4
#define HAS_NORMALS 0x0001 /* flags of a mesh */
#define HAS_TEXCOORDS 0x0002
#define SINGLE_PRECISION 0x1000
#define LEVEL 4         /* half the time of level 6 for a few percent more bytes */
#define BLOCK (1 << 16) /* bytes that are compressed at a time */

/* Compresses its input with zlib and writes it to the sink. */
struct packer {
    z_stream zlib;
    struct sink *out;
    size_t used;
    unsigned char in[BLOCK], packed[BLOCK];
};

static void pack_flush(struct packer *p, int how) {
    p->zlib.next_in = p->in;
    p->zlib.avail_in = (uInt)p->used;
    do {
        p->zlib.next_out = p->packed;
        p->zlib.avail_out = BLOCK;
        deflate(&p->zlib, how); /* fails only where its state was damaged */
        sink_bytes(p->out, p->packed, BLOCK - p->zlib.avail_out);
    } while (p->zlib.avail_out == 0);
    p->used = 0;
}

static void pack(struct packer *p, const void *data, size_t length) {
    if (p->used + length > BLOCK)
        pack_flush(p, Z_NO_FLUSH);
    memcpy(p->in + p->used, data, length);
    p->used += length;
}

static void pack_u32(struct packer *p, uint32_t value) {
    value = htole32(value);
    pack(p, &value, sizeof value);
}

static void pack_u64(struct packer *p, uint64_t value) {
    value = htole64(value);
    pack(p, &value, sizeof value);
}

static void pack_float(struct packer *p, float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    pack_u32(p, bits);
}

static void pack_vec3(struct packer *p, vec3 v) {
    pack_float(p, v.x);
    pack_float(p, v.y);
    pack_float(p, v.z);
}

static void pack_part(struct packer *p, const struct export_input *in, const struct parts *parts,
                      const struct part *part) {
    const struct seams *seams = &parts->seams;
    char name[PARTS_LABEL_BYTES];
    parts_label(in->segments, in->mesh, part->segment, name);
    pack_u32(p, (in->mesh->normal ? HAS_NORMALS : 0) | HAS_TEXCOORDS | SINGLE_PRECISION);
    pack(p, name, strlen(name) + 1);
    pack_u64(p, part->vertex_count);
    pack_u64(p, part->triangle_count);
    size_t end = part->first_vertex + part->vertex_count;
    for (size_t v = part->first_vertex; v < end; v++)
        pack_vec3(p, seams_position(seams, in->mesh, v));
    for (size_t v = part->first_vertex; v < end && in->mesh->normal; v++)
        pack_vec3(p, seams_normal(seams, in->mesh, v));
    for (size_t v = part->first_vertex; v < end; v++) {
        vec2 uv = seams_uv(seams, in->atlas, v);
        pack_float(p, uv.x);
        pack_float(p, uv.y);
    }
    for (size_t i = part->first_triangle; i < part->first_triangle + part->triangle_count; i++)
        for (int c = 0; c < 3; c++)
            pack_u32(p, seams->index[parts->order[i]][c] - (uint32_t)part->first_vertex);
}

enum status mitsuba_shapes_write(const char *path, const struct export_input *in, const struct parts *parts,
                                 struct error *err) {
    struct sink out;
    enum status status = sink_open(&out, path, 0, err);
    if (status != STATUS_OK)
        return status;
    uint64_t *place = mem_array(parts->count, sizeof *place);
    struct packer *packer = mem_calloc(1, sizeof *packer);
    packer->out = &out;
    if (deflateInit(&packer->zlib, LEVEL) != Z_OK)
        mem_exhausted("zlib");
    for (size_t i = 0; i < parts->count; i++) {
        place[i] = out.written;
        sink_u32(&out, FORMAT | VERSION << 16);
        pack_part(packer, in, parts, &parts->part[i]);
        pack_flush(packer, Z_FINISH);
        deflateReset(&packer->zlib);
    }
    deflateEnd(&packer->zlib);
    for (size_t i = 0; i < parts->count; i++)
        sink_u64(&out, place[i]);
    sink_u32(&out, (uint32_t)parts->count);
    mem_free(packer);
    mem_free(place);
    return sink_close(&out, STATUS_OK, err);
}
