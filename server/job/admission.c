/* admission.c -- see admission.h. */
#include "server/job/admission.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "common/json.h"
#include "common/kept_pixels.h"
#include "common/machine.h"
#include "common/mem.h"
#include "common/output_names.h"
#include "common/settings.h"
#include "server/job/memory_reduction.h"

/* Memory of a render: of the program with its threads and pictures, and for each byte of the room and the textures in
 * their files. Rooms of 0.5, 1.7, 6 and 36 MiB in files took 23, 27, 65 and 163 MiB, at 320 x 240: 4 to 7.4 times their
 * files and 20 MiB. */
#define RENDER_BYTES (64.0 * 0x1p20)
#define RENDER_FACTOR 8.0
/* And of files that were sent to it. A picture of an inserted mesh is resampled (relight/bake.h): 75 bytes for each of
 * its pixels, up to 1.15 GiB a mesh (measured: squares with pictures of 1024, 2048 and 2890 pixels a side took 75, 298
 * and 588 MiB more than the room; one whose atlas is as large as may be, with all of colour, emission and roughness,
 * 1148 MiB). How many pixels a file has is not known here: JPEG has 2 to 7 to the byte, PNG 0.3 to 2, both more where
 * they are plain. By hand: 16. */
#define PIXEL_BYTES 75.0
#define PIXELS_PER_BYTE 16.0
#define PICTURE_BYTES_MAX (1.15 * 0x1p30) /* of a mesh; an environment's picture takes no more */
#define HINT "It begins when others have ended. Smaller textures, or of a render smaller files, need less memory."

void admission_init(struct admission *a, uint64_t limit_bytes, uint64_t worker_limit_bytes) {
    *a = (struct admission){.limit_bytes = limit_bytes, .worker_limit_bytes = worker_limit_bytes, .told_id = -1};
}

/* What the check of a scene foretells (check/check_table.h). */
struct foretold {
    double bytes, texel_bytes;
    double side;        /* texels of the textures that `bytes` are for */
    double kept;        /* pixels of a photograph that they are for; 0: all */
    double whole_bytes; /* where all are kept */
};

static bool read_foretold(const char *text, struct foretold *f) {
    cJSON *facts = cJSON_Parse(text);
    *f = (struct foretold){0};
    bool is_foretold =
        facts && json_number(facts, "memory_bytes", "facts", 0.0, &f->bytes, NULL) == STATUS_OK &&
        json_number(facts, "memory_texel_bytes", "facts", 0.0, &f->texel_bytes, NULL) == STATUS_OK &&
        json_number(facts, "memory_texture_size", "facts", 0.0, &f->side, NULL) == STATUS_OK &&
        json_number(facts, "memory_kept_pixels", "facts", 0.0, &f->kept, NULL) == STATUS_OK &&
        json_number(facts, "memory_whole_bytes", "facts", f->bytes, &f->whole_bytes, NULL) == STATUS_OK &&
        f->bytes > 0.0;
    cJSON_Delete(facts);
    return is_foretold;
}

/* For the textures that the next attempt makes and the pixels that it keeps; as foretold where its settings cannot be
 * read. */
static double bytes_for(const struct job *job, const struct foretold *f) {
    struct settings settings;
    struct buf what;
    int threads = 1;
    double bytes = f->bytes;
    cJSON *given = cJSON_Parse(job->settings);
    buf_init(&what, 4096);
    cJSON *reduced = memory_reduction_apply(job->kind, given, job->memory_step, &threads, &what);
    settings_init(&settings);
    if (settings_apply(&settings, reduced, NULL, NULL) == STATUS_OK) {
        double side = settings_number(&settings, "texture_size"), kept = kept_pixels(&settings, side);
        bool keeps_more = f->kept > 0.0 && (kept == 0.0 || kept > f->kept);
        bytes = (keeps_more ? f->whole_bytes : f->bytes) + f->texel_bytes * (side * side - f->side * f->side);
    }
    settings_release(&settings);
    cJSON_Delete(reduced);
    cJSON_Delete(given);
    buf_release(&what);
    return fmax(bytes, 0.0);
}

double admission_need(const struct admission *a, const char *text, const struct job *job) {
    struct foretold foretold;
    if (!read_foretold(text, &foretold))
        return 0.0;
    double bytes = bytes_for(job, &foretold);
    return a->worker_limit_bytes > 0 ? fmin(bytes, (double)a->worker_limit_bytes) : bytes;
}

/* Whether the file may hold pictures that are compressed. */
static bool has_pictures(const char *name) {
    static const char *const endings[] = {".png",  ".jpg", ".jpeg", ".webp", ".avif",
                                          ".heic", ".tif", ".tiff", ".glb",  ".gltf"};
    const char *dot = strrchr(name, '.');
    for (size_t i = 0; dot && i < sizeof endings / sizeof *endings; i++)
        if (strcasecmp(dot, endings[i]) == 0)
            return true;
    return false;
}

/* How many of the settings name what pictures are for: a mesh or an environment. */
static double count_pictured(const char *settings) {
    double count = 0.0;
    cJSON *json = cJSON_Parse(settings);
    for (const cJSON *s = json ? json->child : NULL; s; s = s->next) {
        size_t length = strlen(s->string);
        bool is_insert = strncmp(s->string, "insert.", 7) == 0 && strcmp(s->string + length - 5, ".file") == 0;
        count += is_insert || strcmp(s->string, "environment") == 0;
    }
    cJSON_Delete(json);
    return count;
}

/* What the files take that were sent to a render. */
static double need_of_files(const struct job *job) {
    double pictures = 0.0, rest = 0.0;
    cJSON *files = cJSON_Parse(job->files);
    for (const cJSON *f = files ? files->child : NULL; f; f = f->next) {
        const char *name = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(f, "name"));
        double bytes = cJSON_GetNumberValue(cJSON_GetObjectItemCaseSensitive(f, "bytes"));
        if (name && bytes > 0.0) /* NAN: it is not there yet */
            *(has_pictures(name) ? &pictures : &rest) += bytes;
    }
    cJSON_Delete(files);
    return RENDER_FACTOR * rest +
           fmin(PIXEL_BYTES * PIXELS_PER_BYTE * pictures, PICTURE_BYTES_MAX * count_pictured(job->settings));
}

/* A render holds the room and its textures, which are larger there than in their files, and what was sent to it. */
static enum status need_of_render(const struct admission *a, struct store *store, const struct job *job, double *need,
                                  struct error *err) {
    struct output_row *rows = NULL;
    size_t count = 0;
    double bytes = 0.0;
    enum status status = store_output_list(store, job->source_id, &rows, &count, err);
    for (size_t i = 0; i < count; i++) {
        size_t length = strlen(rows[i].name);
        bool is_read = !strchr(rows[i].name, '/') && length > 4 &&
                       (strcmp(rows[i].name + length - 4, ".exr") == 0 || strcmp(rows[i].name, OUTPUT_MESH) == 0);
        bytes += is_read ? (double)rows[i].bytes : 0.0;
        output_row_release(&rows[i]);
    }
    mem_free(rows);
    *need = RENDER_BYTES + RENDER_FACTOR * bytes + need_of_files(job);
    if (a->worker_limit_bytes > 0)
        *need = fmin(*need, (double)a->worker_limit_bytes);
    return status;
}

enum status admission_foretell(const struct admission *a, struct store *store, const struct job *job, double *need,
                               struct error *err) {
    struct scene_row scene = {0};
    *need = 0.0;
    if (job->kind == JOB_RENDER)
        return need_of_render(a, store, job, need, err);
    enum status status = store_scene_get(store, job->scene_id, &scene, err);
    if (status == STATUS_OK)
        *need = admission_need(a, scene.facts, job);
    scene_row_release(&scene);
    return status;
}

static enum status find_need(const struct admission *a, struct store *store, int64_t id, double *need,
                             struct error *err) {
    struct job job = {0};
    *need = 0.0;
    enum status status = store_job_get(store, id, &job, err);
    if (status == STATUS_OK)
        status = admission_foretell(a, store, &job, need, err);
    job_release(&job);
    return status == STATUS_NOT_FOUND ? STATUS_OK : status; /* deleted meanwhile: its start will find that */
}

/* Tells the job `id` (0: none) that it waits, and another one that it does not any more. */
static enum status tell(struct admission *a, struct store *store, int64_t id, double need, struct error *err) {
    char reason[200];
    if (a->told_id == id)
        return STATUS_OK;
    enum status status = a->told_id == 0
                             ? STATUS_OK
                             : store_job_explain(store, a->told_id > 0 ? a->told_id : 0, "", ADMISSION_REASON, "", err);
    if (status != STATUS_OK)
        return status;
    a->told_id = 0;
    if (id == 0)
        return STATUS_OK;
    snprintf(reason, sizeof reason,
             ADMISSION_REASON ": it needs about %.1f GiB, and all jobs that run may take %.1f GiB together",
             need / 0x1p30, a->total_bytes / 0x1p30);
    status = store_job_explain(store, id, reason, "", HINT, err);
    a->told_id = status == STATUS_OK ? id : 0;
    return status;
}

enum status admission_decide(struct admission *a, struct store *store, int64_t id, size_t running, double used,
                             bool *may, double *need, struct error *err) {
    enum status status = find_need(a, store, id, need, err);
    if (running == 0)
        a->total_bytes = (double)(a->limit_bytes > 0 ? a->limit_bytes : machine_memory_available(""));
    *may = running == 0 || *need <= 0.0 || a->total_bytes <= 0.0 || used + *need <= a->total_bytes;
    return status == STATUS_OK ? tell(a, store, *may ? 0 : id, *need, err) : status;
}
