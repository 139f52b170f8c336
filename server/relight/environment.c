/* environment.c -- see environment.h. */
#include "server/relight/environment.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/relight/files.h"
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

static void scale_map(struct image *map, double scale) {
    for (size_t i = 0; i < (size_t)map->width * map->height * map->channel_count; i++)
        map->pixel[i] *= (float)scale;
}

enum status environment_read(const struct relight_job *job, const struct compass *compass, uint32_t sun, bool *has,
                             struct image *map, struct error *err) {
    const cJSON *s = job->settings;
    double scale = render_settings_number(s, "environment_scale"), unit;
    struct image picture = {0};
    struct sky sky;
    *map = (struct image){0};
    *has = false;
    if (render_settings_is(s, "environment", "none"))
        return STATUS_OK;
    if (render_settings_is(s, "environment", "sky")) {
        enum status status = environment_sky(job, sun, &sky, err);
        if (status != STATUS_OK)
            return status;
        unit = render_settings_number(s, "luminance_per_unit");
        sky_map(&sky, compass, map);
        scale_map(map, scale / (unit > 0.0 ? unit : ENVIRONMENT_SKY_UNIT));
        *has = true;
        return STATUS_OK;
    }
    bool is_found = render_settings_is(s, "environment", "found");
    char *path =
        is_found ? file_join(job->outputs, "environment.exr") : files_path(job, render_settings_text(s, "environment"));
    if (is_found && access(path, F_OK) != 0) {
        mem_free(path);
        return STATUS_OK;
    }
    enum status status = read_map(path, &picture, err);
    if (status == STATUS_OK) {
        environment_orient(&picture, is_found ? ENVIRONMENT_OF_ROOM : ENVIRONMENT_OF_FILE, compass,
                           (float)render_settings_number(s, "environment_turn"), (float)scale, map);
        *has = true;
    }
    image_release(&picture);
    mem_free(path);
    return status;
}
