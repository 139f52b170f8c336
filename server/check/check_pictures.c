/* check_pictures.c -- see check_pictures.h. */
#include "server/check/check_pictures.h"

#include "common/file.h"
#include "common/mem.h"
#include "server/check/exposure_chart.h"
#include "server/check/overlay.h"
#include "server/check/plan_picture.h"

#define REMEDY_OVERLAYS 2 /* of the photographs again, as they would lie by a remedy that is not taken */

struct overlay_job {
    const struct scene_check *room;
    const char *dir;
    size_t count; /* overlays by the poses as loaded; the others are by the remedy */
    struct overlay_work {
        size_t photograph;
        char *name;
        enum status status;
        struct error err;
    } work[CHECK_OVERLAYS + REMEDY_OVERLAYS];
};

static enum status write_canvas(const struct drawing *drawing, const char *dir, const char *name, struct error *err) {
    char *path = file_join(dir, name);
    enum status status = drawing_write(drawing, path, err);
    mem_free(path);
    return status;
}

static void draw_overlay(void *user, size_t number, int thread) {
    struct overlay_job *job = user;
    struct overlay_work *work = &job->work[number];
    const struct scene *scene = &job->room->scene;
    const struct photograph *photo = &scene->photograph[work->photograph];
    struct camera camera = photo->camera;
    struct drawing drawing;
    (void)thread;
    if (number >= job->count)
        hypothesis_camera(&job->room->fit.search.best, scene, work->photograph, &camera);
    overlay_draw(&drawing, photo, &camera, job->room->accel);
    work->status = write_canvas(&drawing, job->dir, work->name, &work->err);
    drawing_release(&drawing);
}

static void add(cJSON *previews, const char *name, char *caption) {
    cJSON *entry = cJSON_CreateObject();
    json_add_string(entry, "name", name);
    json_add_string(entry, "caption", caption);
    cJSON_AddItemToArray(previews, entry);
    mem_free(caption);
}

static enum status write_overlays(const struct scene_check *room, const char *dir, struct parallel *pool,
                                  cJSON *previews, struct error *err) {
    size_t total = room->scene.photograph_count, count = total < CHECK_OVERLAYS ? total : CHECK_OVERLAYS;
    size_t remedies = !room->fit.has_remedy ? 0 : count < REMEDY_OVERLAYS ? count : REMEDY_OVERLAYS;
    struct overlay_job job = {.room = room, .dir = dir, .count = count};
    enum status status = STATUS_OK;
    for (size_t i = 0; i < count + remedies; i++) {
        size_t place = i < count ? i : i - count;
        job.work[i].photograph = (2 * place + 1) * total / (2 * count);
        job.work[i].name = mem_printf(i < count ? "overlay_%03zu.png" : "remedy_%03zu.png", place);
    }
    parallel_for(pool, count + remedies, draw_overlay, &job);
    for (size_t i = 0; i < count + remedies; i++) {
        const struct overlay_work *work = &job.work[i];
        const char *photo = room->scene.photograph[work->photograph].name;
        if (status == STATUS_OK && work->status != STATUS_OK) {
            status = work->status;
            *err = work->err;
        }
        add(previews, work->name,
            i < count ? mem_printf("%s: the mesh's edges in green; red where rays meet no surface", photo)
                      : mem_printf("%s: the same by the remedy", photo));
        mem_free(job.work[i].name);
    }
    return status;
}

static enum status write_plan(const struct scene_check *room, const char *dir, struct parallel *pool, cJSON *previews,
                              struct error *err) {
    struct drawing drawing;
    double unseen;
    plan_picture_draw(&drawing, &room->scene, room->accel, pool, &unseen);
    enum status status = write_canvas(&drawing, dir, "plan.png", err);
    drawing_release(&drawing);
    add(previews, "plan.png",
        mem_printf(
            "from above: cameras in blue; in red the surface that no photograph sees, %.0f %%; the bar is one metre",
            100.0 * unseen));
    return status;
}

static enum status write_exposures(const struct scene_check *room, const char *dir, cJSON *previews,
                                   struct error *err) {
    struct drawing drawing;
    struct exposure_range range = exposure_chart_draw(&drawing, &room->scene, room->fit.brightness);
    enum status status = write_canvas(&drawing, dir, "exposure.png", err);
    drawing_release(&drawing);
    char *given = range.given_stops > 0.0
                      ? mem_printf("; in red the exposures that the files state, over %.1f stops", range.given_stops)
                      : mem_strdup("");
    add(previews, "exposure.png",
        mem_printf("by frame, a line a stop: in blue the photographs' brightness, over %.1f stops%s",
                   range.brightness_stops, given));
    mem_free(given);
    return status;
}

enum status check_pictures_write(const struct scene_check *room, const char *dir, struct parallel *pool,
                                 cJSON *previews, check_pictures_drawn *drawn, void *user, struct error *err) {
    enum status status = write_overlays(room, dir, pool, previews, err);
    if (status == STATUS_OK && drawn)
        drawn(user);
    if (status == STATUS_OK)
        status = write_plan(room, dir, pool, previews, err);
    if (status == STATUS_OK && drawn)
        drawn(user);
    if (status == STATUS_OK)
        status = write_exposures(room, dir, previews, err);
    return status;
}
