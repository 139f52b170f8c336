/* cameras.c -- see cameras.h. */
#include "server/relight/cameras.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/output_names.h"
#include "server/ingest/transforms.h"
#include "server/relight/setting_files.h"
#include "server/scene/coordinates.h"

#define DEFAULT_PANORAMA_WIDTH 2048 /* pixels */

void cameras_release(struct cameras *v) {
    for (size_t i = 0; i < v->count; i++)
        mem_free(v->view[i].name);
    mem_free(v->view);
    *v = (struct cameras){0};
}

static void add_view(struct cameras *v, const struct camera *camera, const char *name) {
    if ((v->count & (v->count - 1)) == 0) /* 0 and powers of two: a path may have 100,000 views */
        v->view = mem_realloc_array(v->view, v->count ? 2 * v->count : 1, sizeof *v->view);
    v->view[v->count++] = (struct placed_camera){*camera, mem_strdup(name)};
}

/* --- from a file ------------------------------------------------------------------------------------------------ */

/* The frame of a name or a number; NULL: there is none. */
static const struct frame *find_frame(const struct frames *t, const char *view) {
    char *end;
    unsigned long number = strtoul(view, &end, 10);
    for (size_t i = 0; i < t->frame_count; i++)
        if (strcmp(t->frame[i].file, view) == 0)
            return &t->frame[i];
    for (size_t i = 0; i < t->frame_count && end != view && *end == '\0'; i++)
        if (t->frame[i].number == number)
            return &t->frame[i];
    return NULL;
}

static enum status add_frame(struct cameras *v, const struct frame *frame, const char *path, const double offset[3],
                             struct error *err) {
    struct camera camera;
    if (isnan(frame->lens.width) || isnan(frame->lens.height))
        return error_set(err, STATUS_INPUT,
                         "%s: frames[%zu] does not say how large its picture is: w and h are missing", path,
                         frame->number);
    enum status status =
        frame_camera(frame, (uint32_t)frame->lens.width, (uint32_t)frame->lens.height, offset, &camera, err);
    if (status == STATUS_OK)
        add_view(v, &camera, frame->file);
    return status;
}

/* The frames that `which` lists: numbers and names separated by commas, or all. */
static enum status add_frames(struct cameras *v, const struct frames *t, const char *which, const char *setting,
                              const char *path, const double offset[3], struct error *err) {
    enum status status = STATUS_OK;
    if (strcmp(which, "all") == 0) {
        for (size_t i = 0; i < t->frame_count && status == STATUS_OK; i++)
            status = add_frame(v, &t->frame[i], path, offset, err);
        return status;
    }
    for (const char *at = which; status == STATUS_OK;) {
        size_t length = strcspn(at, ",");
        char *word = mem_strndup(at, length);
        const struct frame *frame = find_frame(t, word);
        if (frame)
            status = add_frame(v, frame, path, offset, err);
        else
            status = error_set(err, STATUS_INPUT, "setting %s: %s has no view \"%s\" among its %zu", setting, path,
                               word, t->frame_count);
        mem_free(word);
        if (at[length] == '\0')
            break;
        at += length + 1;
    }
    return status;
}

static char *cameras_path(const struct relight_job *job) {
    if (render_settings_is(job->settings, "cameras", "held_out"))
        return file_join(job->outputs, OUTPUT_VIEWS);
    if (render_settings_is(job->settings, "cameras", "photographs"))
        return file_join(job->outputs, OUTPUT_CAMERAS);
    return setting_files_path(job, render_settings_text(job->settings, "cameras"));
}

cJSON *cameras_own(const struct relight_job *job) {
    bool is_own = render_settings_is(job->settings, "cameras", "held_out") ||
                  render_settings_is(job->settings, "cameras", "photographs");
    char *path = cameras_path(job);
    cJSON *tree = NULL;
    if (is_own)
        (void)json_read(path, TRANSFORMS_MAX_BYTES, &tree, NULL);
    mem_free(path);
    return tree;
}

/* The axis that points up in most frames, as scene_up has it of photographs. */
static vec3 up_of(const struct frames *t) {
    double sum[3] = {0.0, 0.0, 0.0};
    int most = 1;
    for (size_t i = 0; i < t->frame_count; i++)
        for (int c = 0; c < 3; c++)
            sum[c] -= t->frame[i].world_from_camera.rotation[c][1];
    for (int c = 0; c < 3; c++)
        most = fabs(sum[c]) > fabs(sum[most]) ? c : most;
    float sign = sum[most] < 0.0 ? -1.0f : 1.0f;
    return vec3_make(most == 0 ? sign : 0.0f, most == 1 ? sign : 0.0f, most == 2 ? sign : 0.0f);
}

static vec3 choose_up(const cJSON *settings, const struct frames *t) {
    const char *up = render_settings_text(settings, "up");
    if (strcmp(up, "auto") == 0)
        return up_of(t);
    return vec3_make(*up == 'x' ? 1.0f : 0.0f, *up == 'y' ? 1.0f : 0.0f, *up == 'z' ? 1.0f : 0.0f);
}

static const char *name_of(const char *path) {
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

static enum status read_frames(const struct relight_job *job, const char *path, const double offset[3],
                               struct cameras *v, struct error *err) {
    struct findings findings = {.problems = cJSON_CreateArray()};
    struct frames t = {0};
    cJSON *tree = NULL;
    const char *setting = render_settings_has(job->settings, "path") ? "path" : "view";
    const char *shown = job->files ? name_of(path) : path; /* where it lies on a server is not its user's affair */
    enum status status = json_read(path, TRANSFORMS_MAX_BYTES, &tree, err);
    if (status == STATUS_NOT_FOUND)
        status = error_set(err, STATUS_INPUT, "setting cameras: the reconstruction has no %s", shown);
    if (status == STATUS_OK) {
        transforms_read(tree, shown, &t, &findings);
        const cJSON *first = cJSON_GetArrayItem(findings.problems, 0);
        if (findings.problem_count > 0)
            status = error_set(err, STATUS_INPUT, "%s: %s", shown,
                               cJSON_GetStringValue(cJSON_GetObjectItem(first, "reason")));
    }
    if (status == STATUS_OK) {
        v->compass = compass_of(choose_up(job->settings, &t));
        status = add_frames(v, &t, render_settings_text(job->settings, setting), setting, shown, offset, err);
    }
    if (status == STATUS_OK && v->count == 0)
        status = error_set(err, STATUS_INPUT, "setting cameras: %s has no view", shown);
    frames_release(&t);
    cJSON_Delete(findings.problems);
    findings_release(&findings);
    cJSON_Delete(tree);
    return status;
}

/* --- a path ----------------------------------------------------------------------------------------------------- */

struct quaternion {
    double v[4]; /* w x y z */
};

/* Shepperd's method (1978). */
static struct quaternion quaternion_of(const float m[3][3]) {
    double r[3][3], q[4];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            r[i][j] = (double)m[i][j];
    double trace = r[0][0] + r[1][1] + r[2][2];
    int k = 0; /* the largest component: w, or that of the largest diagonal element */
    double largest = trace;
    for (int i = 0; i < 3; i++)
        if (r[i][i] > largest) {
            largest = r[i][i];
            k = i + 1;
        }
    if (k == 0) {
        q[0] = 1.0 + trace;
        q[1] = r[2][1] - r[1][2];
        q[2] = r[0][2] - r[2][0];
        q[3] = r[1][0] - r[0][1];
    } else {
        int a = k - 1, b = (a + 1) % 3, c = (a + 2) % 3;
        q[0] = r[c][b] - r[b][c];
        q[1 + a] = 1.0 + r[a][a] - r[b][b] - r[c][c];
        q[1 + b] = r[b][a] + r[a][b];
        q[1 + c] = r[c][a] + r[a][c];
    }
    double length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    return (struct quaternion){{q[0] / length, q[1] / length, q[2] / length, q[3] / length}};
}

static void rotation_of(const double q[4], float m[3][3]) {
    double r[3][3];
    coordinates_rotation(q, r);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            m[i][j] = (float)r[i][j];
}

/* Weights of four knots at `t` between the second and the third: a Catmull-Rom spline, which goes through them with a
 * continuous velocity. */
static void spline(double t, double weight[4]) {
    double t2 = t * t, t3 = t2 * t;
    weight[0] = 0.5 * (-t + 2.0 * t2 - t3);
    weight[1] = 0.5 * (2.0 - 5.0 * t2 + 3.0 * t3);
    weight[2] = 0.5 * (t + 4.0 * t2 - 3.0 * t3);
    weight[3] = 0.5 * (-t2 + t3);
}

/* Position and rotation at `at` in [0, knots - 1]; quaternions of neighbours are on one side, so that their weighted
 * sum, normalised, is between them. */
static struct camera camera_at(const struct placed_camera *knot, const struct quaternion *turn, size_t knots,
                               double at) {
    size_t first = at >= (double)(knots - 1) ? knots - 2 : (size_t)at;
    double weight[4], q[4] = {0.0, 0.0, 0.0, 0.0}, p[3] = {0.0, 0.0, 0.0}, square = 0.0;
    spline(at - (double)first, weight);
    for (size_t k = 0; k < 4; k++) {
        size_t i = first + k < 1 ? 0 : first + k - 1;
        i = i < knots ? i : knots - 1;
        vec3 o = knot[i].camera.world_from_camera.translation;
        p[0] += weight[k] * (double)o.x;
        p[1] += weight[k] * (double)o.y;
        p[2] += weight[k] * (double)o.z;
        for (int c = 0; c < 4; c++)
            q[c] += weight[k] * turn[i].v[c];
    }
    for (int c = 0; c < 4; c++)
        square += q[c] * q[c];
    for (int c = 0; c < 4; c++)
        q[c] /= sqrt(square);
    struct camera camera = knot[0].camera;
    rotation_of(q, camera.world_from_camera.rotation);
    camera.world_from_camera.translation = vec3_make((float)p[0], (float)p[1], (float)p[2]);
    camera.camera_from_world = rigid_inverse(&camera.world_from_camera);
    return camera;
}

/* Replaces the views by pictures along the path through them, with the lens of the first. */
static enum status make_path(const cJSON *settings, struct cameras *v, struct error *err) {
    size_t count = (size_t)render_settings_number(settings, "path_count"), knots = v->count;
    struct cameras path = {.compass = v->compass};
    if (knots < 2)
        return error_set(err, STATUS_INPUT, "setting path: needs at least two views");
    struct quaternion *turn = mem_array(knots, sizeof *turn);
    for (size_t i = 0; i < knots; i++) {
        turn[i] = quaternion_of(v->view[i].camera.world_from_camera.rotation);
        double dot = 0.0;
        for (int c = 0; c < 4 && i > 0; c++)
            dot += turn[i].v[c] * turn[i - 1].v[c];
        for (int c = 0; c < 4 && dot < 0.0; c++)
            turn[i].v[c] = -turn[i].v[c];
    }
    for (size_t i = 0; i < count; i++) {
        double at = (double)(knots - 1) * (double)i / (double)(count - 1);
        struct camera camera = camera_at(v->view, turn, knots, at);
        char *name = mem_printf("path/%05zu", i);
        add_view(&path, &camera, name);
        mem_free(name);
    }
    mem_free(turn);
    cameras_release(v);
    *v = path;
    return STATUS_OK;
}

/* --- size, panorama --------------------------------------------------------------------------------------------- */

/* Level, looking where the camera looks. */
static void make_panorama(const struct compass *compass, uint32_t width, uint32_t height, struct camera *camera) {
    vec3 down = vec3_neg(compass->up), ahead = rigid_direction(&camera->world_from_camera, vec3_make(0.0f, 0.0f, 1.0f));
    ahead = vec3_mad(ahead, -vec3_dot(ahead, compass->up), compass->up);
    ahead = vec3_length(ahead) > 1e-3f ? vec3_normalize(ahead) : compass->north;
    vec3 right = vec3_cross(down, ahead);
    struct rigid pose = {{{right.x, down.x, ahead.x}, {right.y, down.y, ahead.y}, {right.z, down.z, ahead.z}},
                         camera->world_from_camera.translation};
    *camera = (struct camera){.model = CAMERA_PANORAMA, .width = width, .height = height, .world_from_camera = pose};
    camera->camera_from_world = rigid_inverse(&pose);
}

void camera_resize(struct camera *c, uint32_t width, uint32_t height) {
    if (c->model == CAMERA_PANORAMA) {
        c->width = width;
        c->height = height;
        return;
    }
    float scale = fmaxf((float)width / (float)c->width, (float)height / (float)c->height);
    c->cx = 0.5f * (float)width + scale * (c->cx - 0.5f * (float)c->width);
    c->cy = 0.5f * (float)height + scale * (c->cy - 0.5f * (float)c->height);
    c->fx *= scale;
    c->fy *= scale;
    c->width = width;
    c->height = height;
    camera_find_fold(c);
}

static void shape(const cJSON *settings, struct cameras *v) {
    uint32_t width = DEFAULT_PANORAMA_WIDTH, height = DEFAULT_PANORAMA_WIDTH / 2;
    bool is_sized = render_settings_size(settings, &width, &height);
    for (size_t i = 0; i < v->count; i++) {
        if (render_settings_bool(settings, "panorama"))
            make_panorama(&v->compass, width, height, &v->view[i].camera);
        else if (is_sized)
            camera_resize(&v->view[i].camera, width, height);
        v->view[i].camera.looks_in = render_settings_bool(settings, "look_in");
    }
}

enum status cameras_read(const struct relight_job *job, const double offset[3], struct cameras *v, struct error *err) {
    char *path = cameras_path(job);
    *v = (struct cameras){0};
    enum status status = read_frames(job, path, offset, v, err);
    if (status == STATUS_OK && render_settings_has(job->settings, "path"))
        status = make_path(job->settings, v, err);
    if (status == STATUS_OK)
        shape(job->settings, v);
    else
        cameras_release(v);
    mem_free(path);
    return status;
}
