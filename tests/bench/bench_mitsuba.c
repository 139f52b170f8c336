/* Paths per second against Mitsuba 3 on the same rooms: same geometry, atlas, materials, view, depth
 * and samples, both on all cores, the two taking turns. Argument: a Python with Mitsuba. Prints
 * lines "name value goal better". */
#include <sys/wait.h>

#include "common/file.h"
#include "server/export/mesh_ply.h"
#include "server/export/pictures.h"
#include "tests/bench/engine.h"

#define REPEATS 5

/* Mitsuba in a process of its own, asked through pipes. */
struct other {
    pid_t pid;
    FILE *to, *from;
};

static void other_start(struct other *o, const char *python, const char *dir) {
    int in[2], out[2];
    char spp[16], depth[16];
    snprintf(spp, sizeof spp, "%d", SPP);
    snprintf(depth, sizeof depth, "%d", DEPTH);
    CHECK(pipe(in) == 0 && pipe(out) == 0);
    o->pid = fork();
    if (o->pid == 0) {
        dup2(in[0], 0);
        dup2(out[1], 1);
        close(in[1]);
        close(out[0]);
        execl(python, python, "tests/bench/mitsuba_room.py", dir, spp, depth, (char *)NULL);
        _exit(127);
    }
    close(in[0]);
    close(out[1]);
    o->to = fdopen(in[1], "w");
    o->from = fdopen(out[0], "r");
}

static void other_stop(struct other *o) {
    fclose(o->to);
    fclose(o->from);
    waitpid(o->pid, NULL, 0);
}

/* Its seconds for one picture. */
static double other_ask(struct other *o, const char *what) {
    char line[256];
    fprintf(o->to, "%s\n", what);
    fflush(o->to);
    return fgets(line, sizeof line, o->from) ? atof(line) : 0.0;
}

static void write_room(const struct room *room, const struct camera *c, const char *dir) {
    struct error err;
    room_must(file_make_dirs(dir, &err), &err);
    char *path = file_join(dir, "scene.ply");
    room_must(mesh_ply_write(path, &room->mesh, &room->segments, &room->atlas, &err), &err);
    mem_free(path);
    struct image image;
    image_init_rgb(&image, room->atlas.width, room->atlas.height);
    for (size_t i = 0; i < (size_t)image.width * image.height; i++)
        memcpy(image.pixel + 3 * i, room->materials.base_color.texel[i], 3 * sizeof(float));
    path = file_join(dir, "base_color.exr");
    room_must(image_write_exr(path, &image, IMAGE_FLOAT, false, &err), &err);
    mem_free(path);
    image_release(&image);
    path = file_join(dir, "room.json");
    FILE *file = fopen(path, "w");
    CHECK(file != NULL);
    const struct rigid *m = &c->world_from_camera;
    const vec3 t = m->translation;
    fprintf(file, "{\"camera\": {\"width\": %u, \"height\": %u, \"fx\": %.9g, \"world_from_camera\": [", c->width,
            c->height, (double)c->fx);
    for (int i = 0; i < 3; i++)
        fprintf(file, "[%.9g, %.9g, %.9g, %.9g], ", (double)m->rotation[i][0], (double)m->rotation[i][1],
                (double)m->rotation[i][2],
                (double)(i == 0   ? t.x
                         : i == 1 ? t.y
                                  : t.z));
    fprintf(file, "[0, 0, 0, 1]]},\n\"segments\": [");
    for (size_t s = 0; s < room->segments.count; s++) {
        rgb e = room->materials.emission[s];
        fprintf(file, "%s\n{\"roughness\": %.9g, \"specular\": %.9g, \"emission\": [%.9g, %.9g, %.9g]}", s ? "," : "",
                (double)room->materials.roughness[s], (double)room->materials.specular[s], (double)e.r, (double)e.g,
                (double)e.b);
    }
    fprintf(file, "]}\n");
    fclose(file);
    mem_free(path);
}

/* Continues base colour beyond the charts, as the outputs of a job do: others filter over them. */
static void extend_base_color(struct room *room) {
    struct inverse_uv inverse;
    inverse_uv_make(&inverse, &room->atlas, room->mesh.triangle_count, room->pool);
    uint32_t *source = picture_margin(&inverse);
    float(*texel)[4] = room->materials.base_color.texel;
    for (size_t i = 0; i < (size_t)inverse.width * inverse.height; i++) {
        if (source[i] != INVERSE_UV_NONE && source[i] != i)
            memcpy(texel[i], texel[source[i]], 3 * sizeof **texel);
    }
    mem_free(source);
    inverse_uv_release(&inverse);
}

static void bench_room(const char *python, const char *name) {
    struct room room;
    struct camera camera;
    char dir[256];
    load_view(&room, name, &camera);
    extend_base_color(&room);
    const char *build = getenv("UNBAKE_BUILD");
    snprintf(dir, sizeof dir, "%s/bench/%s", build ? build : "build", name);
    write_room(&room, &camera, dir);
    struct other other;
    char line[256] = "";
    other_start(&other, python, dir);
    if (!fgets(line, sizeof line, other.from) || strncmp(line, "ready", 5) != 0) {
        fprintf(stderr, "mitsuba does not run here: its lines are left out\n");
        other_stop(&other);
        exit(77);
    }
    struct work work;
    work_init(&work, &room, &camera, 0);
    work.settings.derivatives = false;
    work.settings.min_color = 0.0f;
    run(&work, false);
    double mean = 0.0;
    for (size_t i = 0; i < work.path_count; i++)
        mean +=
            (double)(work.radiance[i].r + work.radiance[i].g + work.radiance[i].b) / (3.0 * (double)work.path_count);
    fprintf(stderr, "%s: our mean %.5g, theirs %s", name, mean, line + 6);
    double ours[2][REPEATS], theirs[2][REPEATS];
    for (int i = 0; i < REPEATS; i++) {
        for (int gradient = 0; gradient < 2; gradient++) {
            work.settings.derivatives = gradient;
            work.settings.min_color = gradient ? PATH_MIN_COLOR : 0.0f;
            ours[gradient][i] = run(&work, gradient);
            theirs[gradient][i] = other_ask(&other, gradient ? "gradient" : "primal");
        }
    }
    other_stop(&other);
    double paths = (double)work.path_count * 1e-6;
    for (int gradient = 0; gradient < 2; gradient++) {
        double a = median(ours[gradient], REPEATS), b = median(theirs[gradient], REPEATS);
        fprintf(stderr, "%s: %s: ours %.3f, Mitsuba's %.3f million paths per second\n", name,
                gradient ? "gradient" : "primal", paths / a, paths / b);
        printf("%s paths over Mitsuba 3 (%s)\t%.4f\t%s\thigher\n", gradient ? "gradient" : "primal", name, b / a,
               gradient ? "4" : "1.2");
    }
    work_release(&work);
}

int main(int argc, char **argv) {
    if (argc < 2)
        return 2;
    bench_room(argv[1], "staircase2");
    bench_room(argv[1], "bathroom");
    return 0;
}
