/* bundle.c -- see bundle.h. */
#include "server/ingest/bundle.h"

#include <assert.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/ingest/archive.h"
#include "server/ingest/mesh_file.h"
#include "server/ingest/path.h"
#include "server/ingest/photos.h"
#include "server/ingest/reading_apply.h"
#include "server/ingest/source/sources.h"
#include "server/ingest/transforms.h"

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

/* The bundle's root: `dir`, or the single folder in it; the caller's. */
static enum status find_root(const char *dir, char **root, struct error *err) {
    char **names;
    size_t count;
    struct stat info;
    enum status status = list_folder(dir, &names, &count, err);
    *root = NULL;
    if (status != STATUS_OK)
        return status;
    char *inner = count == 1 ? file_join(dir, names[0]) : NULL;
    if (inner && lstat(inner, &info) != 0)
        status = error_set_errno(err, errno, "cannot look at %s", inner);
    else
        *root = mem_strdup(inner && S_ISDIR(info.st_mode) ? inner : dir);
    mem_free(inner);
    file_free_names(names, count);
    return status;
}

/* --- cameras ----------------------------------------------------------------------------- */

static void tell_no_cameras(const char *name, struct findings *f) {
    struct error own;
    error_set(&own, STATUS_INPUT, "no cameras: the bundle has no %s, nor poses of another kind", name);
    error_hint(&own, "nerfstudio and instant-ngp write one; COLMAP, ScanNet and NICE-SLAM's Replica are read, too");
    findings_error(f, name, &own);
}

/* The cameras of the file that was chosen, or of whatever source the bundle is; sets *match. */
static enum status load_cameras(const struct listing *l, const char *chosen, struct source_match *match,
                                struct transforms *t, struct findings *f, struct error *err) {
    *t = (struct transforms){0};
    *match = sources_find(l, chosen);
    if (!match->source && chosen && listing_find(l, "", chosen)) /* of another name */
        *match = (struct source_match){&source_nerfstudio, mem_strdup(""), mem_strdup(chosen)};
    if (!match->source) {
        tell_no_cameras(chosen ? chosen : BUNDLE_TRANSFORMS, f);
        return STATUS_OK;
    }
    struct source_place place = {l, match->base, match->found};
    return match->source->read(&place, t, f, err);
}

/* --- mesh -------------------------------------------------------------------------------- */

static enum status file_has_faces(const char *root, const char *name, bool *has, struct error *err) {
    char *path = file_join(root, name);
    enum status status = mesh_file_has_faces(path, name, has, err);
    mem_free(path);
    return status;
}

/* Mesh files at the top level. */
struct bundle_candidates {
    char **name; /* [count] sorted */
    size_t count;
    size_t point_cloud_count;
    const char *first, *second; /* meshes */
    const char *unknown;        /* a mesh in a format that we do not read */
};

/* Among PLY files, or among files of the other formats. */
static enum status find_candidates(struct bundle_candidates *c, const char *root, bool ply, struct error *err) {
    static const char *const unknown[] = {"stl", "fbx", "off", "usd", "usdz", "dae", "3ds"};
    for (size_t i = 0; i < c->count; i++) {
        bool has_faces;
        const char *extension = path_extension(c->name[i]);
        for (size_t k = 0; k < sizeof unknown / sizeof *unknown; k++)
            if (strcasecmp(extension, unknown[k]) == 0)
                c->unknown = c->name[i];
        if (!mesh_file_is_known(c->name[i]) || (strcasecmp(extension, "ply") == 0) != ply)
            continue;
        enum status status = file_has_faces(root, c->name[i], &has_faces, err);
        if (status != STATUS_OK)
            return status;
        if (!has_faces)
            c->point_cloud_count++;
        else if (!c->first)
            c->first = c->name[i];
        else if (!c->second)
            c->second = c->name[i];
    }
    return STATUS_OK;
}

/* The only PLY with faces at the top level, else the only mesh of another format. NULL with a problem when there is
 * none or more than one. */
static enum status search_mesh(const char *root, char **found, struct findings *f, struct error *err) {
    struct bundle_candidates c = {0};
    struct error two;
    enum status status = list_folder(root, &c.name, &c.count, err);
    if (status == STATUS_OK)
        status = find_candidates(&c, root, true, err);
    if (status == STATUS_OK && !c.first)
        status = find_candidates(&c, root, false, err);
    if (status != STATUS_OK) {
        file_free_names(c.name, c.count);
        return status;
    }
    if (c.second) {
        error_set(&two, STATUS_INPUT, "two meshes: %s and %s", c.first, c.second);
        error_hint(&two, "leave one, or name it in transforms.json as \"mesh\"");
        findings_error(f, c.second, &two);
    } else if (c.first) {
        *found = mem_strdup(c.first);
    } else if (c.unknown) {
        findings_problem(f, c.unknown, "no mesh: the format of %s is not read; a mesh must be " MESH_FILE_FORMATS,
                         c.unknown);
    } else {
        findings_problem(f, "mesh.ply",
                         c.point_cloud_count > 0 ? "no mesh: the PLY files at the bundle's top are point clouds"
                                                 : "no mesh: the bundle has no " MESH_FILE_FORMATS " file at its top");
    }
    file_free_names(c.name, c.count);
    return STATUS_OK;
}

/* Name of the mesh file, the caller's; NULL with a problem. */
static enum status find_mesh(const char *root, const char *transforms_name, const struct transforms *t, char **found,
                             struct findings *f, struct error *err) {
    *found = NULL;
    if (t->mesh || t->point_cloud) {
        const char *name = t->mesh ? t->mesh : t->point_cloud;
        bool is_there = file_is_in(root, name), is_mesh = t->mesh != NULL;
        if (t->mesh && !is_there) {
            findings_problem(f, transforms_name, "\"mesh\" names %s, which is not in the bundle", name);
            return STATUS_OK;
        }
        enum status status = is_mesh || !is_there ? STATUS_OK : file_has_faces(root, name, &is_mesh, err);
        if (status != STATUS_OK)
            return status;
        if (is_mesh) {
            *found = mem_strdup(name);
            return STATUS_OK;
        }
    }
    return search_mesh(root, found, f, err);
}

/* The one that the reading names. */
static enum status choose_mesh(const char *root, const char *name, char **found, struct findings *f,
                               struct error *err) {
    struct error own;
    enum status status = path_clean(name, found, &own);
    if (status == STATUS_OK && !file_is_in(root, *found)) {
        findings_problem(f, name, "the mesh that was chosen, %s, is not in the bundle", name);
        mem_free(*found);
        *found = NULL;
    }
    return findings_settle(f, name, status, &own, err);
}

static enum status load_mesh(const char *root, const char *name, const struct reading *reading, uint64_t triangle_limit,
                             struct scene *scene, struct findings *f, struct error *err) {
    struct faces_report report;
    struct error own;
    char *path = file_join(root, name);
    size_t limit = triangle_limit < MESH_MAX_TRIANGLES ? (size_t)triangle_limit : MESH_MAX_TRIANGLES;
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

enum status bundle_load(const char *dir, const struct reading *given, const struct bundle_limits *limits,
                        struct parallel *pool, struct scene *scene, cJSON *problems, struct error *err) {
    struct findings f = {.problems = problems};
    struct transforms t = {0};
    struct listing listing = {0};
    struct source_match match = {0};
    char *root = NULL, *mesh = NULL, *chosen = NULL;
    struct reading reading = given ? *given : reading_default();
    *scene = (struct scene){0};
    enum status status = clean_choice(reading.transforms, &chosen, err);
    if (status == STATUS_OK)
        status = find_root(dir, &root, err);
    if (status == STATUS_OK)
        status = listing_read(&listing, root, err);
    if (status == STATUS_OK)
        status = load_cameras(&listing, chosen, &match, &t, &f, err);
    if (status != STATUS_OK)
        goto out;
    const char *name = match.found ? match.found : chosen ? chosen : BUNDLE_TRANSFORMS;
    bool has_frames = f.problem_count == 0 || t.frame_count > 0;
    reading_apply_frames(&reading, &t);
    scene->pose_axes = reading.axes != AXES_OF_FORMAT ? reading.axes : t.axes;
    if (reading.mesh)
        status = choose_mesh(root, reading.mesh, &mesh, &f, err);
    else
        status = find_mesh(root, name, &t, &mesh, &f, err);
    if (mesh)
        status = load_mesh(root, mesh, &reading, limits->triangles, scene, &f, err);
    if (status == STATUS_OK && has_frames)
        status = photos_load(root, name, &t, limits->photograph_pixels, pool, scene, &f, err);
    if (status == STATUS_OK && f.problem_count > 0)
        status = sum_up(&f, err);
    if (status == STATUS_OK) {
        scene->source = mem_strdup(match.source->name);
        scene->named_count = t.named_count;
        check_frames_meet_mesh(scene, &f);
        move_warnings(&f, scene);
    }
out:
    if (status != STATUS_OK)
        scene_release(scene);
    findings_release(&f);
    transforms_release(&t);
    source_match_release(&match);
    listing_release(&listing);
    mem_free(mesh);
    mem_free(root);
    mem_free(chosen);
    return status;
}
