/* bundle.c -- see bundle.h. */
#include "server/ingest/bundle.h"

#include <assert.h>
#include <errno.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/ingest/applied_transform.h"
#include "server/ingest/archive.h"
#include "server/ingest/duplicate_frames.h"
#include "server/ingest/frames.h"
#include "server/ingest/mesh/mesh_file.h"
#include "server/ingest/mesh_choice.h"
#include "server/ingest/path.h"
#include "server/ingest/photos.h"
#include "server/ingest/reading_apply.h"
#include "server/ingest/source/sources.h"
#include "server/ingest/source/unsupported.h"

struct bundle_limits bundle_default_limits(void) {
    return (struct bundle_limits){
        .file_count = 100000,
        .total_bytes = (uint64_t)256 << 30,
        .ratio = 200.0, /* deflate's maximum is 1032; photographs of rooms stay below 20 */
        .photograph_pixels = (uint64_t)1 << 28,
        .triangles = (uint64_t)1 << 26,
    };
}

enum status bundle_unpack(const char *archive, const char *dir, const struct bundle_limits *limits, struct error *err) {
    struct archive_limits own = {limits->file_count, limits->total_bytes, limits->ratio};
    return archive_unpack(archive, "the archive", dir, &own, err);
}

/* --- the folder -------------------------------------------------------------------------- */

/* Names in a folder, sorted, without hidden and operating systems' files; the caller's (file_free_names). */
static enum status list_folder(const char *dir, char ***names, size_t *count, struct error *err) {
    enum status status = file_list(dir, names, count, err);
    size_t kept = 0;
    for (size_t i = 0; i < *count; i++) {
        char *name = (*names)[i];
        if (name[0] == '.' || path_is_litter(name))
            mem_free(name);
        else
            (*names)[kept++] = name;
    }
    *count = kept;
    return status;
}

enum status bundle_root(const char *dir, char **root, struct error *err) {
    *root = mem_strdup(dir);
    for (int depth = 0; depth < LISTING_MAX_DEPTH; depth++) {
        char **names;
        size_t count;
        struct stat info;
        enum status status = list_folder(*root, &names, &count, err);
        char *inner = status == STATUS_OK && count == 1 ? file_join(*root, names[0]) : NULL;
        if (inner && lstat(inner, &info) != 0)
            status = error_set_errno(err, errno, "cannot access %s", inner);
        bool is_folder = inner && status == STATUS_OK && S_ISDIR(info.st_mode);
        file_free_names(names, count);
        if (is_folder) {
            mem_free(*root);
            *root = inner;
        } else {
            mem_free(inner);
            return status;
        }
    }
    return STATUS_OK;
}

/* Lists *root, or `dir` above it where only that is a capture's layout ("keyframes/" alone is part of one). */
static enum status list_bundle(const char *dir, char **root, struct listing *l, struct error *err) {
    enum status status = listing_read(l, *root, err);
    if (status != STATUS_OK || strcmp(*root, dir) == 0)
        return status;
    struct listing outer = {0};
    struct source_match inner = sources_find(l, NULL), match = {0};
    status = inner.source ? STATUS_OK : listing_read(&outer, dir, err);
    if (status == STATUS_OK && !inner.source) {
        match = sources_find(&outer, NULL);
        struct listing unused = match.source ? *l : outer;
        *l = match.source ? outer : *l;
        listing_release(&unused);
        if (match.source) {
            mem_free(*root);
            *root = mem_strdup(dir);
        }
    } else {
        listing_release(&outer);
    }
    source_match_release(&inner);
    source_match_release(&match);
    return status;
}

/* --- cameras ----------------------------------------------------------------------------- */

/* The cameras of the file that was chosen, or of whatever source the bundle is; sets *match. */
static enum status load_cameras(const struct listing *l, const char *chosen, struct source_match *match,
                                struct frames *t, struct findings *f, struct error *err) {
    *t = (struct frames){0};
    *match = sources_find(l, chosen);
    if (!match->source && chosen && listing_find(l, "", chosen)) /* of another name */
        *match = (struct source_match){&source_nerfstudio, mem_strdup(""), mem_strdup(chosen), NULL};
    if (!match->source) {
        unsupported_tell_cameras(l, chosen, f);
        return STATUS_OK;
    }
    struct source_place place = {l, match->base, match->found};
    size_t problem_count = f->problem_count;
    enum status status = match->source->read(&place, t, f, err);
    if (status == STATUS_OK && t->named_count == 0 && f->problem_count == problem_count)
        findings_problem(f, match->found, "holds no poses (%s): the photographs were not aligned", match->source->name);
    if (match->other)
        findings_warning(f,
                         "there is more than one capture of %s: %s is taken, not %s; transforms=NAME chooses another",
                         match->source->name, match->found, match->other);
    return status;
}

/* --- mesh -------------------------------------------------------------------------------- */

/* Of several meshes those that fit the memory are taken. A triangle costs about so much while a room is reconstructed:
 * Embree's tree and what it is built from 250 bytes, the mesh, its neighbours and its atlas 150. */
#define TRIANGLE_BYTES 400

static uint64_t triangle_limit(const struct bundle_limits *limits) {
    long pages = sysconf(_SC_PHYS_PAGES), bytes = sysconf(_SC_PAGESIZE);
    uint64_t fits = pages > 0 && bytes > 0 ? (uint64_t)pages * (uint64_t)bytes / TRIANGLE_BYTES : MESH_MAX_TRIANGLES;
    uint64_t own = limits->triangles < MESH_MAX_TRIANGLES ? limits->triangles : MESH_MAX_TRIANGLES;
    return fits < own ? fits : own;
}

static enum status load_mesh(const char *root, const char *name, const struct reading *reading,
                             const struct bundle_limits *limits, struct scene *scene, struct findings *f,
                             struct error *err) {
    struct faces_report report;
    struct error own;
    char *path = file_join(root, name);
    size_t limit = limits->triangles < MESH_MAX_TRIANGLES ? (size_t)limits->triangles : MESH_MAX_TRIANGLES;
    enum status status = mesh_file_read(path, name, limit, &scene->mesh, &report, &own);
    mem_free(path);
    if (status == STATUS_OK)
        reading_apply_mesh(reading, &scene->mesh);
    if (status == STATUS_OK)
        status = mesh_check(&scene->mesh, name, &scene->mesh_report, &own);
    if (status != STATUS_OK)
        return findings_settle(f, name, status, &own, err);
    mesh_file_warn(name, &scene->mesh, &report, &scene->mesh_report, f);
    return STATUS_OK;
}

/* Poses in other units or axes than the mesh's would only fail late and confusingly. */
static void check_frames_meet_mesh(const struct scene *scene, struct findings *f) {
    vec3 lower, upper;
    mesh_bounds(&scene->mesh, &lower, &upper);
    vec3 centre = vec3_scale(vec3_add(lower, upper), 0.5f);
    float reach = 2.0f * vec3_length(vec3_sub(upper, lower));
    size_t far_count = 0;
    for (size_t i = 0; i < scene->photograph_count; i++) {
        vec3 origin = camera_origin(&scene->photograph[i].camera);
        far_count += vec3_length(vec3_sub(origin, centre)) > reach;
    }
    if (far_count > 0)
        findings_warning(f,
                         "%zu of %zu cameras stand farther from the mesh's centre than twice its "
                         "diagonal: are poses and mesh in the same units and axes?",
                         far_count, scene->photograph_count);
}

/* Those of the poses from now on, and the others, for the check of fit. */
static enum status settle_coordinates(struct frames *t, const char *name, const char *given, struct scene *scene,
                                      struct findings *f, struct error *err) {
    struct error own;
    enum status status =
        frames_choose_coordinates(t, given, scene->mesh.triangle_count > 0 ? &scene->mesh : NULL, &own);
    if (status == STATUS_OK && t->stands_apart)
        findings_warning(
            f,
            "%s: the cameras are georeferenced and stand far from the mesh in all coordinates that the file "
            "knows: export the model in local or geocentric (EPSG:4978) ones, or in UTM with heights above the ellipsoid",
            name);
    memcpy(scene->other, t->other, sizeof scene->other);
    scene->other_count = t->other_count;
    return findings_settle(f, name, status, &own, err);
}

/* --- all of it --------------------------------------------------------------------------- */

static void move_warnings(struct findings *f, struct scene *scene) {
    if (f->warning_count > FINDINGS_MAX) {
        char *last = f->warning[FINDINGS_MAX - 1];
        f->warning[FINDINGS_MAX - 1] = mem_printf("... and %zu warnings more", f->warning_count - FINDINGS_MAX + 1);
        mem_free(last);
        f->warning_count = FINDINGS_MAX;
    }
    scene->warning = f->warning;
    scene->warning_count = f->warning_count;
    f->warning = NULL;
    f->warning_count = 0;
}

static enum status sum_up(const struct findings *f, struct error *err) {
    const cJSON *first = cJSON_GetArrayItem(f->problems, 0);
    const char *reason = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(first, "reason"));
    const char *file = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(first, "file"));
    if (f->problem_count > FINDINGS_MAX) {
        cJSON *more = cJSON_CreateObject();
        json_add_string(more, "file", "");
        char *text = mem_printf("... and %zu problems more", f->problem_count - FINDINGS_MAX);
        json_add_string(more, "reason", text);
        cJSON_AddItemToArray(f->problems, more);
        mem_free(text);
    }
    assert(file && reason); /* set by add_problem */
    if (f->problem_count == 1)
        return error_set(err, STATUS_INPUT, "%s: %s", file, reason);
    return error_set(err, STATUS_INPUT, "%zu problems; the first: %s: %s", f->problem_count, file, reason);
}

/* The file of cameras that the reading names, cleaned, the caller's; NULL: none is named. */
static enum status clean_choice(const char *given, char **chosen, struct error *err) {
    *chosen = NULL;
    enum status status = given ? path_clean(given, chosen, err) : STATUS_OK;
    if (status == STATUS_OK && given && (*chosen)[0] == '\0')
        status = error_set(err, STATUS_INPUT, "\"%s\" is no name of a file", given);
    return status;
}

static enum status load_photographs(const char *root, const char *name, const struct frames *t,
                                    const struct bundle_limits *limits, struct parallel *pool, struct scene *scene,
                                    struct findings *f, struct error *err) {
    const struct photos_options options = {
        .pixel_limit = limits->photograph_pixels,
        .decode_bytes = limits->decode_bytes,
        .spill = limits->spill,
        .later_bytes = limits->later_bytes,
        .kept_pixels = limits->kept_pixels,
    };
    return photos_load(root, name, t, &options, pool, scene, f, err);
}

enum status bundle_load(const char *dir, const struct reading *given, const struct bundle_limits *limits,
                        struct parallel *pool, struct scene *scene, cJSON *problems, struct error *err) {
    struct findings f = {.problems = problems};
    struct frames t = {0};
    struct listing listing = {0};
    struct source_match match = {0};
    char *root = NULL, *mesh = NULL, *chosen = NULL;
    struct reading reading = given ? *given : reading_default();
    *scene = (struct scene){0};
    enum status status = clean_choice(reading.transforms, &chosen, err);
    if (status == STATUS_OK)
        status = bundle_root(dir, &root, err);
    if (status == STATUS_OK)
        status = list_bundle(dir, &root, &listing, err);
    if (status == STATUS_OK)
        status = load_cameras(&listing, chosen, &match, &t, &f, err);
    if (status != STATUS_OK)
        goto out;
    const char *name = match.found ? match.found : chosen ? chosen : BUNDLE_TRANSFORMS;
    bool has_frames = f.problem_count == 0 || t.frame_count > 0;
    struct mesh_choice choice = {&listing, &match, &t, reading.mesh, triangle_limit(limits)};
    if (match.source) /* else what is missing has been said */
        status = mesh_choose(&choice, &mesh, &f, err);
    if (match.source == &source_nerfstudio)
        applied_transform_settle(&t, name, mesh, reading.coordinates, &f);
    if (mesh)
        status = load_mesh(root, mesh, &reading, limits, scene, &f, err);
    if (status == STATUS_OK && match.source)
        status = settle_coordinates(&t, name, reading.coordinates, scene, &f, err);
    reading_apply_frames(&reading, &t);
    scene->pose_axes = reading.axes != AXES_OF_FORMAT ? reading.axes : t.axes;
    duplicate_frames_remove(&t, name, &f);
    if (status == STATUS_OK && has_frames)
        status = load_photographs(root, name, &t, limits, pool, scene, &f, err);
    if (status == STATUS_OK && f.problem_count > 0 && listing.link_count > 0)
        findings_warning(&f, "links are not searched, %s for one (%zu in all); unbake submit sends what they point to",
                         listing.link, listing.link_count);
    if (status == STATUS_OK && f.problem_count > 0)
        status = sum_up(&f, err);
    if (status == STATUS_OK) {
        scene->source = mem_strdup(match.source->name);
        scene->named_count = t.named_count;
        check_frames_meet_mesh(scene, &f);
    }
out:
    if (status != STATUS_OK)
        scene_release(scene);
    move_warnings(&f, scene);
    findings_release(&f);
    frames_release(&t);
    source_match_release(&match);
    listing_release(&listing);
    mem_free(mesh);
    mem_free(root);
    mem_free(chosen);
    return status;
}
