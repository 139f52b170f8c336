/* environment.c -- see environment.h. */
#include "server/relight/environment.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/output_names.h"
#include "server/relight/setting_files.h"
#include "server/render/light.h"

void environment_orient(const struct image *picture, enum environment_frame frame, const struct compass *compass,
                        float turn_deg, float scale, struct image *out) {
    struct lights *lights = lights_new(picture);
    float turn = turn_deg * (float)(PI / 180.0), c = cosf(turn), s = sinf(turn);
    image_init_rgb(out, picture->width, picture->height);
    for (uint32_t y = 0; y < out->height; y++) {
        for (uint32_t x = 0; x < out->width; x++) {
            vec3 d = latlong_pixel(out->width, out->height, x, y), p = compass_to_map(compass, d);
            vec3 turned = {c * p.x - s * p.z, p.y, s * p.x + c * p.z};
            if (frame == ENVIRONMENT_OF_ROOM)
                turned = turn == 0.0f ? d : compass_from_map(compass, turned);
            rgb value = rgb_scale(lights_environment(lights, turned), scale);
            memcpy(out->pixel + 3 * ((size_t)y * out->width + x), &value, sizeof value);
        }
    }
    lights_free(lights);
}

static enum status read_map(const char *path, struct image *picture, struct error *err) {
    struct image_info info;
    enum status status = image_read(path, picture, &info, err);
    if (status != STATUS_OK)
        return status;
    if (picture->channel_count < 3 || picture->height < 2)
        status = error_set(err, STATUS_INPUT, "%s: a picture of %u x %u pixels in %u channels is no environment", path,
                           picture->width, picture->height, picture->channel_count);
    size_t values = (size_t)picture->width * picture->height * picture->channel_count;
    for (size_t i = 0; i < values && info.encoding == IMAGE_SRGB; i++)
        picture->pixel[i] = image_srgb_to_linear(picture->pixel[i]);
    return status;
}

uint32_t environment_suns(const struct relight_job *job) {
    return (uint32_t)render_settings_number(job->settings, "suns");
}

enum status environment_sky(const struct relight_job *job, uint32_t sun, struct sky *sky, struct error *err) {
    const cJSON *s = job->settings;
    int year = 0, month = 0, day = 0, hour = 0, minute = 0;
    double latitude = render_settings_number(s, "latitude"), longitude = render_settings_number(s, "longitude");
    double offset =
        render_settings_has(s, "utc_offset") ? render_settings_number(s, "utc_offset") : round(longitude / 15.0);
    sscanf(render_settings_text(s, "date"), "%d-%d-%d", &year, &month, &day);
    sscanf(render_settings_text(s, "time"), "%d:%d", &hour, &minute);
    double hours = hour + minute / 60.0 - offset, rise, set;
    uint32_t suns = environment_suns(job);
    if (suns > 1) {
        if (!sky_day(year, month, day, latitude, longitude, &rise, &set))
            return error_set(err, STATUS_INPUT, "setting suns: on %s the sun does not rise at latitude %g",
                             render_settings_text(s, "date"), latitude);
        hours = rise + (set - rise) * (sun + 0.5) / suns;
    }
    *sky = (struct sky){sky_sun(year, month, day, hours, latitude, longitude), render_settings_number(s, "turbidity"),
                        render_settings_number(s, "north") * PI / 180.0};
    return STATUS_OK;
}

static void tint_map(struct image *map, const double factor[3]) {
    for (size_t i = 0; i < (size_t)map->width * map->height * map->channel_count; i++)
        map->pixel[i] *= (float)factor[i % map->channel_count];
}

static void add_map(struct image *sum, const struct image *map) {
    for (size_t i = 0; i < (size_t)sum->width * sum->height * sum->channel_count; i++)
        sum->pixel[i] += map->pixel[i];
}

static enum status read_sky(const struct relight_job *job, const struct compass *compass, uint32_t sun,
                            enum distant_part part, struct image *map, struct error *err) {
    struct sky sky;
    double unit = render_settings_number(job->settings, "luminance_per_unit");
    enum status status = environment_sky(job, sun, &sky, err);
    if (status != STATUS_OK)
        return status;
    sky_map(&sky, compass, part, map);
    double scale =
        render_settings_number(job->settings, "environment_scale") / (unit > 0.0 ? unit : ENVIRONMENT_SKY_UNIT);
    tint_map(map, (double[3]){scale, scale, scale});
    return STATUS_OK;
}

/* The part of what was found: the reconstruction writes the sky without its sun beside the whole, where there is a
 * sun. */
static enum status read_found(const struct relight_job *job, enum distant_part part, struct image *picture,
                              struct error *err) {
    char *whole = file_join(job->outputs, OUTPUT_ENVIRONMENT), *without = file_join(job->outputs, OUTPUT_SKY);
    bool has_sun = access(without, F_OK) == 0;
    struct image sky = {0};
    enum status status = STATUS_OK;
    if (access(whole, F_OK) == 0 && (has_sun || part != DISTANT_SUN))
        status = read_map(has_sun && part == DISTANT_SKY ? without : whole, picture, err);
    if (status == STATUS_OK && has_sun && part == DISTANT_SUN && picture->pixel)
        status = read_map(without, &sky, err);
    if (status == STATUS_OK && sky.pixel &&
        (sky.width != picture->width || sky.height != picture->height || sky.channel_count != picture->channel_count))
        status = error_set(err, STATUS_INPUT, "%s is not as large as %s", without, whole);
    if (status == STATUS_OK && sky.pixel) {
        tint_map(&sky, (double[3]){-1.0, -1.0, -1.0});
        add_map(picture, &sky);
    }
    image_release(&sky);
    mem_free(without);
    mem_free(whole);
    return status;
}

/* A part as it is, *has false where there is none: a map of a file has no sun of its own. */
static enum status read_part(const struct relight_job *job, const struct compass *compass, uint32_t sun,
                             enum distant_part part, bool *has, struct image *map, struct error *err) {
    const cJSON *s = job->settings;
    bool is_found = render_settings_is(s, "environment", "found");
    struct image picture = {0};
    enum status status = STATUS_OK;
    *map = (struct image){0};
    if (render_settings_is(s, "environment", "sky")) {
        status = read_sky(job, compass, sun, part, map, err);
    } else if (is_found) {
        status = read_found(job, part, &picture, err);
    } else if (!render_settings_is(s, "environment", "none") && part != DISTANT_SUN) {
        char *path = setting_files_path(job, render_settings_text(s, "environment"));
        status = read_map(path, &picture, err);
        mem_free(path);
    }
    if (status == STATUS_OK && picture.pixel)
        environment_orient(&picture, is_found ? ENVIRONMENT_OF_ROOM : ENVIRONMENT_OF_FILE, compass,
                           (float)render_settings_number(s, "environment_turn"),
                           (float)render_settings_number(s, "environment_scale"), map);
    image_release(&picture);
    *has = status == STATUS_OK && map->pixel;
    return status;
}

/* A part under the setting of its name. */
static enum status read_tinted(const struct relight_job *job, const struct compass *compass, uint32_t sun,
                               enum distant_part part, bool *has, struct image *map, struct error *err) {
    const char *name = part == DISTANT_SUN ? "sun" : "sky";
    double factor[3];
    enum status status = read_part(job, compass, sun, part, has, map, err);
    if (status != STATUS_OK || !render_settings_has(job->settings, name))
        return status;
    if (!*has)
        return error_set(err, STATUS_INPUT, "setting %s: the reconstruction found none", name);
    render_settings_factor(cJSON_GetObjectItemCaseSensitive(job->settings, name), factor);
    tint_map(map, factor);
    return STATUS_OK;
}

enum status environment_read(const struct relight_job *job, const struct compass *compass, uint32_t sun,
                             enum distant_part part, bool *has, struct image *map, struct error *err) {
    bool has_sun;
    struct image disc = {0};
    if (part != DISTANT_WHOLE)
        return read_tinted(job, compass, sun, part, has, map, err);
    if (!render_settings_has(job->settings, "sky") && !render_settings_has(job->settings, "sun"))
        return read_part(job, compass, sun, DISTANT_WHOLE, has, map, err);
    enum status status = read_tinted(job, compass, sun, DISTANT_SKY, has, map, err);
    if (status == STATUS_OK)
        status = read_tinted(job, compass, sun, DISTANT_SUN, &has_sun, &disc, err);
    if (status == STATUS_OK && has_sun)
        add_map(map, &disc);
    if (status != STATUS_OK)
        image_release(map);
    image_release(&disc);
    return status;
}
