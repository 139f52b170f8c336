/* mtl.c -- see mtl.h. */
#include "server/ingest/mesh/mtl.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "common/mem.h"
#include "server/ingest/mesh/mtl_lines.h"

struct mtl_reader {
    const char *name, *folder;
    struct mesh_materials *materials;
    bool *found;
    struct mesh_material *current;                         /* NULL: one that no face uses */
    bool has_color, has_roughness, has_specular, is_matte; /* of it; matte: illum 0 or 1 */
    struct error *err;
};

/* The rest of the line behind a word, or NULL. */
static const char *after(const char *line, const char *word) {
    size_t length = strlen(word);
    if (strncasecmp(line, word, length) != 0 || (line[length] != ' ' && line[length] != '\t'))
        return NULL;
    return line + length + strspn(line + length, " \t");
}

static enum status bad_line(const struct mtl_reader *r, const char *line) {
    return error_set(r->err, STATUS_INPUT, "%s: the line \"%.60s\" is not understood", r->name, line);
}

/* One number, or three; of spectral curves and CIE colours there are none in practice. */
static enum status read_color(const struct mtl_reader *r, const char *line, const char *text, rgb *color) {
    float v[3];
    char *end = (char *)(size_t)text;
    int count = 0;
    for (; count < 3; count++) {
        const char *at = end;
        v[count] = strtof(at, &end);
        if (end == at || !isfinite(v[count]) || v[count] < 0.0f)
            break;
    }
    if (count != 1 && count != 3)
        return bad_line(r, line);
    *color = count == 1 ? rgb_gray(v[0]) : rgb_make(v[0], v[1], v[2]);
    return STATUS_OK;
}

static enum status read_number(const struct mtl_reader *r, const char *line, const char *text, float *number) {
    char *end;
    *number = strtof(text, &end);
    return end == text || !isfinite(*number) ? bad_line(r, line) : STATUS_OK;
}

/* --- pictures ------------------------------------------------------------------------------------- */

/* Takes the options before a picture's name: -o and -s move and scale, -clamp; others that change nothing here are
 * skipped. False: one is not known. */
static bool read_options(const char **text, struct material_map *map) {
    static const struct {
        const char *option;
        int most; /* arguments */
    } skipped[] = {{"-blendu", 1}, {"-blendv", 1}, {"-cc", 1}, {"-texres", 1}, {"-type", 1}, {"-boost", 1}, {"-bm", 1}};
    double move[2] = {0.0, 0.0}, size[2] = {1.0, 1.0};
    while (**text == '-') {
        const char *rest = after(*text, "-clamp");
        bool is_move = after(*text, "-o") != NULL, is_size = after(*text, "-s") != NULL, known = true;
        if (rest) {
            for (int i = 0; i < 2; i++)
                map->wrap[i] = strncasecmp(rest, "on", 2) == 0 ? MATERIAL_WRAP_CLAMP : MATERIAL_WRAP_REPEAT;
            *text = rest + strcspn(rest, " \t");
        } else if (is_move || is_size) {
            *text += 2;
            for (int i = 0; i < 3; i++) {
                char *end;
                double value = strtod(*text, &end);
                if (end == *text || (*end && *end != ' ' && *end != '\t'))
                    break;
                if (i < 2)
                    *(is_move ? &move[i] : &size[i]) = value;
                *text = end;
            }
        } else {
            known = false;
            for (size_t i = 0; i < sizeof skipped / sizeof *skipped && !known; i++) {
                rest = after(*text, skipped[i].option);
                known = rest != NULL;
                if (known)
                    *text = rest + strcspn(rest, " \t");
            }
        }
        if (!known)
            return false;
        *text += strspn(*text, " \t");
    }
    /* (u, v) is scaled, then moved, with v upwards; ours goes down */
    map->turn[0][0] = (float)size[0], map->turn[0][2] = (float)move[0];
    map->turn[1][1] = (float)size[1], map->turn[1][2] = (float)(1.0 - size[1] - move[1]);
    return true;
}

static enum status read_map(const struct mtl_reader *r, const char *line, const char *text,
                            enum material_quantity quantity, int channel) {
    struct material_map map = {.is_there = true, .channel = channel};
    if (!read_options(&text, &map) || !*text)
        return bad_line(r, line);
    enum status status =
        mesh_materials_read_image(r->materials, r->folder, r->name, text, channel < 0, &map.image, r->err);
    if (status == STATUS_OK)
        r->current->map[quantity] = map;
    return status;
}

/* --- lines ---------------------------------------------------------------------------------------- */

static void end_material(struct mtl_reader *r) {
    struct mesh_material *m = r->current;
    if (!m)
        return;
    if (m->map[MATERIAL_BASE_COLOR].is_there && (!r->has_color || rgb_is_black(m->base_color)))
        m->base_color = rgb_gray(1.0f);
    if (m->map[MATERIAL_EMISSION].is_there && rgb_is_black(m->emission))
        m->emission = rgb_gray(1.0f);
    if (m->map[MATERIAL_ROUGHNESS].is_there && !r->has_roughness)
        m->roughness = 1.0f;
    if (m->map[MATERIAL_METALLIC].is_there && m->metallic == 0.0f)
        m->metallic = 1.0f;
    if (r->is_matte && !r->has_specular)
        m->specular = 0.0f;
    m->base_color = rgb_make(fminf(m->base_color.r, 1.0f), fminf(m->base_color.g, 1.0f), fminf(m->base_color.b, 1.0f));
    m->roughness = clampf(m->roughness, 0.0f, 1.0f);
    m->metallic = clampf(m->metallic, 0.0f, 1.0f);
}

static void begin_material(struct mtl_reader *r, const char *name) {
    end_material(r);
    r->current = NULL;
    r->has_color = r->has_roughness = r->has_specular = r->is_matte = false;
    for (size_t i = 0; i < r->materials->material_count; i++)
        if (!r->found[i] && strcmp(r->materials->material[i].name, name) == 0) {
            r->current = &r->materials->material[i];
            r->found[i] = r->current->is_own = true;
            return;
        }
}

static enum status read_specular(struct mtl_reader *r, const char *line, const char *text) {
    rgb color;
    enum status status = read_color(r, line, text, &color);
    if (status != STATUS_OK)
        return status;
    if (rgb_max(color) > 1.01f * rgb_luminance(color))
        mesh_materials_leave_out(r->materials, "colour of Ks");
    r->current->specular = clampf(rgb_luminance(color), 0.0f, 1.0f);
    r->has_specular = r->current->specular > 0.0f;
    return STATUS_OK;
}

/* Roughness by the exponent, where Pr has not told it. */
static enum status read_exponent(struct mtl_reader *r, const char *line, const char *text) {
    float n;
    enum status status = read_number(r, line, text, &n);
    if (status == STATUS_OK && !r->has_roughness)
        r->current->roughness = powf(2.0f / (fmaxf(n, 0.0f) + 2.0f), 0.25f);
    return status;
}

static enum status read_opacity(struct mtl_reader *r, const char *line, const char *text, float opaque) {
    float value;
    if (strncasecmp(text, "-halo", 5) == 0)
        text += 5 + strspn(text + 5, " \t");
    enum status status = read_number(r, line, text, &value);
    if (status == STATUS_OK && value != opaque)
        mesh_materials_leave_out(r->materials, "transparency");
    return status;
}

static enum status read_line(struct mtl_reader *r, const char *line) {
    /* what is left out, by the word that begins the line */
    static const char *const unread[][2] = {
        {"map_Bump", "bump maps"}, {"bump", "bump maps"},     {"norm", "normal maps"}, {"disp", "displacement"},
        {"decal", "decals"},       {"map_d", "transparency"}, {"map_Ks", "map_Ks"},    {"map_Ns", "map_Ns"},
        {"Ps", "sheen"},           {"Pc", "clearcoat"},       {"aniso", "anisotropy"}, {"refl", "reflection maps"}};
    struct mesh_material *m = r->current;
    const char *text;
    if ((text = after(line, "newmtl")) != NULL) {
        begin_material(r, text);
        return STATUS_OK;
    }
    if (!m)
        return STATUS_OK;
    if ((text = after(line, "Kd")) != NULL) {
        r->has_color = true;
        return read_color(r, line, text, &m->base_color);
    }
    if ((text = after(line, "Ke")) != NULL)
        return read_color(r, line, text, &m->emission);
    if ((text = after(line, "Ks")) != NULL)
        return read_specular(r, line, text);
    if ((text = after(line, "Ns")) != NULL)
        return read_exponent(r, line, text);
    if ((text = after(line, "Pr")) != NULL) {
        r->has_roughness = true;
        return read_number(r, line, text, &m->roughness);
    }
    if ((text = after(line, "Pm")) != NULL)
        return read_number(r, line, text, &m->metallic);
    if ((text = after(line, "d")) != NULL)
        return read_opacity(r, line, text, 1.0f);
    if ((text = after(line, "Tr")) != NULL)
        return read_opacity(r, line, text, 0.0f);
    if ((text = after(line, "illum")) != NULL) {
        r->is_matte = *text == '0' || *text == '1';
        return STATUS_OK;
    }
    if ((text = after(line, "map_Kd")) != NULL)
        return read_map(r, line, text, MATERIAL_BASE_COLOR, -1);
    if ((text = after(line, "map_Ke")) != NULL)
        return read_map(r, line, text, MATERIAL_EMISSION, -1);
    if ((text = after(line, "map_Pr")) != NULL)
        return read_map(r, line, text, MATERIAL_ROUGHNESS, 0);
    if ((text = after(line, "map_Pm")) != NULL)
        return read_map(r, line, text, MATERIAL_METALLIC, 0);
    for (size_t i = 0; i < sizeof unread / sizeof *unread; i++)
        if (after(line, unread[i][0]))
            mesh_materials_leave_out(r->materials, unread[i][1]);
    return STATUS_OK;
}

enum status mtl_read(const char *name, const char *text, size_t length, const char *folder,
                     struct mesh_materials *materials, bool *found, struct error *err) {
    struct mtl_reader r = {.name = name, .folder = folder, .materials = materials, .found = found, .err = err};
    const char *end = text + length;
    char *line;
    enum status status = STATUS_OK;
    while (status == STATUS_OK && (line = mtl_next_line(&text, end))) {
        if (line[0] != '#')
            status = read_line(&r, line);
        mem_free(line);
    }
    end_material(&r);
    return status;
}
