/* relit.c -- see relit.h. The room's triangles come first, those that are taken away left out, then the objects'. */
#include "server/relight/relit.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "server/relight/environment.h"
#include "server/relight/insert_objects.h"
#include "server/relight/recovered.h"
#include "server/relight/setting_files.h"
#include "server/relight/virtual_objects.h"

/* --- settings of segments --------------------------------------------------------------------------------------- */

static enum status check_segment(const char *setting, uint32_t segment, size_t count, struct error *err) {
    if (segment < count)
        return STATUS_OK;
    return error_set(err, STATUS_INPUT, "setting %s: the room has segments 0 to %zu", setting, count - 1);
}

static void set_base_color(struct recovered *r, uint32_t segment, rgb color) {
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        size_t texel = r->inverse.valid[i];
        if (r->segments.of_triangle[r->inverse.triangle[texel]] == segment)
            memcpy(r->materials.base_color.texel[texel], &color, sizeof color);
    }
}

/* Even over the segment. */
static void set_emission(struct recovered *r, uint32_t segment, rgb radiance) {
    r->materials.emission[segment] = radiance;
    for (size_t i = 0; i < r->inverse.valid_count && r->materials.emission_pattern; i++) {
        size_t texel = r->inverse.valid[i];
        if (r->segments.of_triangle[r->inverse.triangle[texel]] == segment)
            memset(r->materials.emission_pattern[texel], 0, sizeof r->materials.emission_pattern[texel]);
    }
}

static void change_segment(struct recovered *r, const cJSON *settings, const char *name, uint32_t segment) {
    double v[RENDER_MAX_NUMBERS] = {0.0, 0.0, 0.0};
    const char *what = strrchr(name, '.') + 1;
    render_settings_numbers(settings, name, v);
    rgb color = rgb_make((float)v[0], (float)v[1], (float)v[2]);
    if (strcmp(what, "base_color") == 0)
        set_base_color(r, segment, color);
    else if (strcmp(what, "emission") == 0)
        set_emission(r, segment, color);
    else if (strcmp(what, "roughness") == 0)
        r->materials.roughness[segment] = color.r;
    else
        r->materials.specular[segment] = color.r;
}

/* The emission of segments first, then what is said of lights. */
static enum status change_segments(struct recovered *r, const cJSON *settings, struct error *err) {
    bool is_dark = render_settings_is(settings, "lights", "off");
    float *is_on = mem_calloc(r->segments.count, sizeof *is_on);
    uint32_t segment;
    enum status status = STATUS_OK;
    for (const cJSON *s = settings->child; s && status == STATUS_OK; s = s->next) {
        bool is_light = strncmp(s->string, "light.", 6) == 0;
        if (!is_light && strncmp(s->string, "segment.", 8) != 0)
            continue;
        render_settings_find(s->string, &segment);
        status = check_segment(s->string, segment, r->segments.count, err);
        if (status != STATUS_OK)
            break;
        if (is_light)
            is_on[segment] = 1.0f;
        else
            change_segment(r, settings, s->string, segment);
    }
    for (size_t i = 0; i < r->segments.count && status == STATUS_OK && is_dark; i++)
        if (is_on[i] == 0.0f)
            r->materials.emission[i] = rgb_gray(0.0f);
    for (const cJSON *s = settings->child; s && status == STATUS_OK; s = s->next) {
        double factor[3];
        if (strncmp(s->string, "light.", 6) != 0)
            continue;
        render_settings_find(s->string, &segment);
        render_settings_factor(s, factor);
        r->materials.emission[segment] =
            rgb_mul(r->materials.emission[segment], rgb_make((float)factor[0], (float)factor[1], (float)factor[2]));
    }
    mem_free(is_on);
    return status;
}

/* --- what is taken away ----------------------------------------------------------------------------------------- */

/* Marks the segments of that name in report.json; how many there are. */
static size_t mark_named(const cJSON *report, const char *name, bool *removed, size_t count) {
    size_t found = 0;
    const cJSON *segments = cJSON_GetObjectItemCaseSensitive(report, "segments");
    for (const cJSON *s = segments ? segments->child : NULL; s; s = s->next) {
        const char *its = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(s, "name"));
        double number = cJSON_GetNumberValue(cJSON_GetObjectItemCaseSensitive(s, "segment"));
        if (!its || strcmp(its, name) != 0 || !(number >= 0.0 && number < (double)count))
            continue;
        removed[(size_t)number] = true;
        found++;
    }
    return found;
}

static enum status mark_one(const char *word, const cJSON *report, bool *removed, size_t count, struct error *err) {
    char *end;
    unsigned long number = strtoul(word, &end, 10);
    if (mark_named(report, word, removed, count) > 0)
        return STATUS_OK;
    if (end == word || *end != '\0')
        return error_set(err, STATUS_INPUT, "setting remove: the room has no segment \"%s\"", word);
    enum status status = check_segment("remove", number < UINT32_MAX ? (uint32_t)number : UINT32_MAX, count, err);
    if (status == STATUS_OK)
        removed[number] = true;
    return status;
}

/* removed[count], by the setting `remove`. */
static enum status mark_removed(const struct relight_job *job, bool *removed, size_t count, struct error *err) {
    const char *which = render_settings_text(job->settings, "remove");
    enum status status = STATUS_OK;
    if (*which == '\0')
        return STATUS_OK;
    cJSON *report = setting_files_report(job); /* for names */
    for (const char *at = which; status == STATUS_OK;) {
        size_t length = strcspn(at, ",");
        char *word = mem_strndup(at, length);
        status = mark_one(word, report, removed, count, err);
        mem_free(word);
        if (at[length] == '\0')
            break;
        at += length + 1;
    }
    cJSON_Delete(report);
    return status;
}

static void leave_out(struct recovered *r, struct mesh *mesh, const bool *removed) {
    size_t kept = 0;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        uint32_t segment = r->segments.of_triangle[t];
        if (removed[segment])
            continue;
        mesh_move_triangle(mesh, t, kept);
        memmove(r->atlas.corner[kept], r->atlas.corner[t], sizeof r->atlas.corner[t]);
        r->segments.of_triangle[kept++] = segment;
    }
    mesh->triangle_count = kept;
    for (size_t s = 0; s < r->segments.count; s++)
        if (removed[s])
            r->materials.emission[s] = rgb_gray(0.0f);
}

/* --- all -------------------------------------------------------------------------------------------------------- */

static void add_source(struct relit *r, char *name, uint32_t segment, enum distant_part part) {
    r->source = mem_realloc_array(r->source, r->source_count + 1, sizeof *r->source);
    r->source[r->source_count++] = (struct relit_source){name, segment, part};
}

static void list_sources(struct relit *r, size_t room_segments, const struct virtual_objects *objects) {
    for (uint32_t s = 0; s < r->segments.count; s++) {
        if (!(rgb_luminance(r->materials.emission[s]) > 0.0f))
            continue;
        add_source(r, s < room_segments ? mem_printf("light_%u", s) : insert_objects_name(objects, s - room_segments),
                   s, DISTANT_WHOLE);
    }
    if (r->distant[DISTANT_SKY].pixel)
        add_source(r, mem_strdup("sky"), LIGHT_ENVIRONMENT, DISTANT_SKY);
    if (r->distant[DISTANT_SUN].pixel)
        add_source(r, mem_strdup("sun"), LIGHT_ENVIRONMENT, DISTANT_SUN);
}

static void release_distant(struct relit *r) {
    for (int part = DISTANT_WHOLE; part <= DISTANT_SUN; part++)
        image_release(&r->distant[part]);
}

static enum status read_distant(struct relit *r, const struct relight_job *job, const struct compass *compass,
                                uint32_t sun, struct error *err) {
    bool has, has_parts = render_settings_bool(job->settings, "per_light");
    enum status status = STATUS_OK;
    release_distant(r);
    for (int part = DISTANT_WHOLE; part <= (has_parts ? DISTANT_SUN : DISTANT_WHOLE) && status == STATUS_OK; part++)
        status = environment_read(job, compass, sun, (enum distant_part)part, &has, &r->distant[part], err);
    return status;
}

static const struct image *light_of(const struct relit *r, enum distant_part part) {
    return r->distant[part].pixel ? &r->distant[part] : NULL;
}

/* Takes what recovered_read made, all but the world, which is not there yet. */
static void take(struct recovered *from, struct relit *r) {
    r->segments = from->segments;
    r->atlas = from->atlas;
    r->materials = from->materials;
    from->segments = (struct segments){0};
    from->atlas = (struct atlas){0};
    from->materials = (struct materials){0};
}

static enum status build(const struct relight_job *job, const struct compass *compass, size_t room_segments,
                         const struct virtual_objects *objects, struct parallel *pool, struct relit *r,
                         struct error *err) {
    r->emission = mem_array(r->segments.count, sizeof *r->emission);
    memcpy(r->emission, r->materials.emission, r->segments.count * sizeof *r->emission);
    if (r->mesh.triangle_count == 0)
        return error_set(err, STATUS_INPUT, "setting remove: nothing of the room is left");
    enum status status = read_distant(r, job, compass, 0, err);
    if (status == STATUS_OK)
        status = world_init(&r->world, &r->mesh, &r->segments, &r->atlas, &r->materials, light_of(r, DISTANT_WHOLE),
                            pool, err);
    if (status == STATUS_OK)
        list_sources(r, room_segments, objects);
    return status;
}

enum status relit_make(const struct relight_job *job, struct mesh *mesh, const struct compass *compass,
                       struct parallel *pool, struct relit *r, struct error *err) {
    struct recovered room = {0};
    struct virtual_objects objects = {0};
    *r = (struct relit){.mesh = *mesh};
    *mesh = (struct mesh){0};
    bool *removed = NULL;
    enum status status = recovered_read(job->outputs, &r->mesh, pool, &room, err);
    if (status != STATUS_OK)
        goto out;
    size_t room_segments = room.segments.count;
    removed = mem_calloc(room_segments, sizeof *removed);
    status = change_segments(&room, job->settings, err);
    if (status == STATUS_OK)
        status = mark_removed(job, removed, room_segments, err);
    if (status == STATUS_OK)
        status = virtual_objects_read(job, compass, r->mesh.offset, pool, &objects, err);
    if (status != STATUS_OK)
        goto out;
    leave_out(&room, &r->mesh, removed);
    status = insert_objects(&objects, &room, &r->mesh, err);
    if (status != STATUS_OK)
        goto out;
    r->note = objects.note;
    r->note_count = objects.note_count;
    objects.note = NULL;
    objects.note_count = 0;
    take(&room, r);
    status = build(job, compass, room_segments, &objects, pool, r, err);
out:
    mem_free(removed);
    virtual_objects_release(&objects);
    recovered_release(&room);
    if (status != STATUS_OK)
        relit_release(r);
    return status;
}

void relit_release(struct relit *r) {
    for (size_t i = 0; i < r->source_count; i++)
        mem_free(r->source[i].name);
    mem_free(r->source);
    for (size_t i = 0; i < r->note_count; i++)
        mem_free(r->note[i]);
    mem_free(r->note);
    mem_free(r->emission);
    release_distant(r);
    world_release(&r->world);
    materials_release(&r->materials);
    atlas_release(&r->atlas);
    segments_release(&r->segments);
    mesh_release(&r->mesh);
    *r = (struct relit){0};
}

enum status relit_set_sun(struct relit *r, const struct relight_job *job, const struct compass *compass, uint32_t sun,
                          struct parallel *pool, struct error *err) {
    enum status status = read_distant(r, job, compass, sun, err);
    if (status == STATUS_OK)
        world_set_environment(&r->world, light_of(r, DISTANT_WHOLE), pool);
    return status;
}

void relit_light(struct relit *r, size_t source, struct parallel *pool) {
    bool is_all = source == RELIT_ALL;
    uint32_t alone = is_all ? 0 : r->source[source].segment;
    for (uint32_t s = 0; s < r->segments.count; s++)
        r->materials.emission[s] = is_all || s == alone ? r->emission[s] : rgb_gray(0.0f);
    enum distant_part part = is_all ? DISTANT_WHOLE : r->source[source].part;
    bool is_distant = is_all || alone == LIGHT_ENVIRONMENT;
    world_set_environment(&r->world, is_distant ? light_of(r, part) : NULL, pool);
    world_update_lights(&r->world);
}
