/* mesh_choice.c -- see mesh_choice.h. */
#include "server/ingest/mesh_choice.h"

#include <fnmatch.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "common/buf.h"
#include "common/file.h"
#include "common/mem.h"
#include "server/ingest/mesh/mesh_file.h"
#include "server/ingest/path.h"
#include "server/ingest/source/unsupported.h"

/* Bytes of a triangle in a binary glTF file, about: half a vertex of 32 bytes and three indices. */
#define GLTF_TRIANGLE_BYTES 28
#define NAMES_SHOWN 3 /* of the meshes that were not taken */

struct mesh_candidate {
    const struct listed_file *file;
    int rank;
    size_t distance; /* folders between it and the cameras */
    uint64_t triangles;
};

struct mesh_list {
    size_t count, cloud_count;
    struct mesh_candidate *item; /* [count]; owned */
    const char *unread;          /* a mesh of a format that is not read, or NULL */
};

/* --- what speaks for a file -------------------------------------------------------------------- */

/* Names by which tools tell their final mesh from the ones on the way to it; of the path from the root, or of the name
 * where the pattern has no folder. The first that matches counts. */
static const struct {
    const char *pattern;
    int rank;
} ranks[] = {
    {"*[._-]labels*", -3}, /* ScanNet: coloured by class */
    {"*lod[1-9]*", -3},    /* RealityCapture, games: coarser ones */
    {"*simplif*", -2},
    {"*decimat*", -2},
    {"*low*poly*", -2},
    {"*collision*", -2},
    {"*proxy*", -2},
    {"*bbox*", -2},
    {"*region_segmentations/*", -2}, /* Matterport3D: rooms one by one */
    {"*odm_25dmesh*", -2},           /* OpenDroneMap: relief */
    {"*_preseg*", -1},
    {"*aligned*_semantic*", -1},
    {"*_vh_clean_2.ply", 3},  /* ScanNet: the one that its labels are for */
    {"mesh_semantic.ply", 3}, /* Replica: with object_id */
    {"odm_textured_model_geo.obj", 3},
    {"odm_textured_model.obj", 2},
    {"*_texture.*", 3},       /* OpenMVS */
    {"texturedmesh.*", 3},    /* Meshroom */
    {"textured_output.*", 3}, /* 3D Scanner App */
    {"*matterport_mesh/*", 2},
    {"meshed-poisson.ply", 2},
    {"*_refine.*", 2},
    {"meshed-delaunay.ply", 1},
};

static int rank_of(const char *path) {
    for (size_t i = 0; i < sizeof ranks / sizeof *ranks; i++) {
        const char *subject = strchr(ranks[i].pattern, '/') ? path : path_base(path);
        if (fnmatch(ranks[i].pattern, subject, FNM_CASEFOLD) == 0)
            return ranks[i].rank;
    }
    return 0;
}

/* Whether the name begins with that of the cameras' folder: "room0_mesh.ply" for "a/room0/". */
static bool has_folders_name(const char *path, const char *base) {
    char *folder = mem_strndup(base, strlen(base) > 0 ? strlen(base) - 1 : 0);
    const char *name = path_base(folder), *mesh = path_base(path);
    size_t length = strlen(name);
    bool has = length > 0 && strncmp(mesh, name, length) == 0 && strchr("_-.", mesh[length]);
    mem_free(folder);
    return has;
}

/* Folders up from base and down again to the file. */
static size_t distance_of(const char *path, const char *base) {
    size_t common = 0, count = 0;
    for (size_t i = 0; base[i] && base[i] == path[i]; i++)
        if (base[i] == '/')
            common = i + 1;
    for (const char *p = base + common; *p; p++)
        count += *p == '/';
    for (const char *p = path + common; *p; p++)
        count += *p == '/';
    return count;
}

static uint64_t count_lines_with_faces(const struct mapping *file) {
    const char *at = file->data, *end = at + file->size;
    uint64_t count = 0;
    while (at < end) {
        count += *at == 'f';
        const char *newline = memchr(at, '\n', (size_t)(end - at));
        at = newline ? newline + 1 : end;
    }
    return count;
}

/* Whether there are any, exact for PLY; a guess for the others. 0 for a point cloud. */
static enum status guess_triangles(const struct listing *l, const struct listed_file *file, uint64_t *count,
                                   struct error *err) {
    if (strcasecmp(path_extension(file->path), "ply") != 0) {
        *count = file->bytes / GLTF_TRIANGLE_BYTES + 1;
        return STATUS_OK;
    }
    char *path = file_join(l->root, file->path);
    enum status status = mesh_file_count_faces(path, file->path, count, err);
    mem_free(path);
    return status;
}

/* For comparing: the faces of OBJ files, which must be read whole. */
static enum status count_triangles(const struct listing *l, struct mesh_list *c, struct error *err) {
    enum status status = STATUS_OK;
    for (size_t i = 0; i < c->count && status == STATUS_OK; i++) {
        const struct listed_file *file = c->item[i].file;
        struct mapping content;
        if (strcasecmp(path_extension(file->path), "obj") != 0 || file->bytes == 0)
            continue;
        status = listing_open(l, file->path, "an OBJ file", &content, err);
        if (status == STATUS_OK)
            c->item[i].triangles = count_lines_with_faces(&content);
        mapping_close(&content);
    }
    return status;
}

/* --- candidates ------------------------------------------------------------------------------- */

static void note_unread(struct mesh_list *c, const char *path) {
    static const char *const unread[] = {"stl", "fbx", "off", "usd",   "usda", "usdc", "usdz", "dae",
                                         "3ds", "drc", "x3d", "blend", "abc",  "e57",  "las",  "laz"};
    const char *extension = path_extension(path);
    for (size_t k = 0; k < sizeof unread / sizeof *unread; k++)
        if (strcasecmp(extension, unread[k]) == 0)
            c->unread = path;
}

static enum status find_candidates(const struct mesh_choice *choice, struct mesh_list *c, struct error *err) {
    const struct listing *l = choice->listing;
    const char *base = choice->match->base ? choice->match->base : "";
    c->item = mem_array(l->count + 1, sizeof *c->item);
    for (size_t i = 0; i < l->count; i++) {
        const struct listed_file *file = &l->file[i];
        struct mesh_candidate item = {
            .file = file, .rank = rank_of(file->path), .distance = distance_of(file->path, base)};
        note_unread(c, file->path);
        if (!mesh_file_is_known(file->path))
            continue;
        item.rank += has_folders_name(file->path, base);
        enum status status = guess_triangles(l, file, &item.triangles, err);
        if (status != STATUS_OK)
            return status;
        if (item.triangles > 0)
            c->item[c->count++] = item;
        else
            c->cloud_count++;
    }
    return STATUS_OK;
}

/* The better one first. */
static int by_worth(const void *a, const void *b) {
    const struct mesh_candidate *x = a, *y = b;
    if (x->rank != y->rank)
        return x->rank < y->rank ? 1 : -1;
    if (x->distance != y->distance)
        return x->distance > y->distance ? 1 : -1;
    if (x->triangles != y->triangles)
        return x->triangles < y->triangles ? 1 : -1;
    return strcmp(x->file->path, y->file->path);
}

static enum status are_same(const struct listing *l, const struct listed_file *a, const struct listed_file *b,
                            bool *same, struct error *err) {
    struct mapping x = {0}, y = {0};
    *same = false;
    if (a->bytes != b->bytes)
        return STATUS_OK;
    enum status status = listing_open(l, a->path, "a mesh", &x, err);
    if (status == STATUS_OK)
        status = listing_open(l, b->path, "a mesh", &y, err);
    *same = status == STATUS_OK && memcmp(x.data, y.data, x.size) == 0;
    mapping_close(&x);
    mapping_close(&y);
    return status;
}

/* Moves the ones above the limit to the end, where others are left; returns how many these are. */
static size_t put_last_what_is_too_fine(struct mesh_list *c, uint64_t limit) {
    struct mesh_candidate *sorted = mem_array(c->count, sizeof *sorted);
    size_t kept = 0, fine = 0;
    for (int pass = 0; pass < 2; pass++)
        for (size_t i = 0; i < c->count; i++)
            if ((c->item[i].triangles > limit) == (pass == 1))
                sorted[kept++] = c->item[i], fine += pass == 1;
    mem_free(c->item);
    c->item = sorted;
    return fine < c->count ? fine : 0;
}

static void say_choice(const struct mesh_list *c, size_t too_fine_count, struct findings *f) {
    struct buf others;
    buf_init(&others, 4096);
    for (size_t i = 1; i < c->count && i <= NAMES_SHOWN; i++)
        buf_printf(&others, "%s%s", i > 1 ? ", " : "", c->item[i].file->path);
    if (c->count > NAMES_SHOWN + 1)
        buf_printf(&others, " and %zu more", c->count - NAMES_SHOWN - 1);
    const struct mesh_candidate *a = &c->item[0], *b = &c->item[1];
    findings_warning(f, "of %zu meshes %s is taken, %s, not %s%s; mesh=NAME chooses another", c->count, a->file->path,
                     a->rank > b->rank             ? "which goes by its name"
                     : a->distance < b->distance   ? "which is the nearest to the cameras"
                     : a->triangles > b->triangles ? "the finest"
                     : too_fine_count > 0          ? "the finest within the limit"
                                                   : "the first of equal ones",
                     buf_text(&others), too_fine_count > 0 ? " (finer ones are over the limit)" : "");
    buf_release(&others);
}

/* --- the choice ------------------------------------------------------------------------------- */

static enum status choose_among(const struct mesh_choice *choice, char **found, struct findings *f, struct error *err) {
    struct mesh_list c = {0};
    enum status status = find_candidates(choice, &c, err);
    bool same = true;
    if (status == STATUS_OK && c.count > 1)
        status = count_triangles(choice->listing, &c, err);
    if (status == STATUS_OK && c.count > 1) {
        qsort(c.item, c.count, sizeof *c.item, by_worth);
        size_t too_fine_count = put_last_what_is_too_fine(&c, choice->triangle_limit);
        const struct mesh_candidate *a = &c.item[0], *b = &c.item[1];
        if (a->rank == b->rank && a->distance == b->distance && a->triangles == b->triangles)
            status = are_same(choice->listing, a->file, b->file, &same, err);
        if (status == STATUS_OK && same)
            say_choice(&c, too_fine_count, f);
    }
    if (status == STATUS_OK && !same) {
        struct error two;
        error_set(&two, STATUS_INPUT, "two meshes: %s and %s, and neither is finer", c.item[0].file->path,
                  c.item[1].file->path);
        error_hint(&two, "leave one, or say mesh=%.100s", c.item[0].file->path);
        findings_error(f, c.item[1].file->path, &two);
    } else if (status == STATUS_OK && c.count > 0) {
        *found = mem_strdup(c.item[0].file->path);
    } else if (status == STATUS_OK) {
        unsupported_tell_mesh(choice->listing, choice->match->source, c.unread, c.cloud_count > 0, f);
    }
    mem_free(c.item);
    return status;
}

/* The one that the reading names. */
static void take_wanted(const struct mesh_choice *choice, char **found, struct findings *f) {
    struct error own;
    const char *name = choice->wanted;
    if (path_clean(name, found, &own) != STATUS_OK) {
        findings_error(f, name, &own);
    } else if (!file_is_in(choice->listing->root, *found)) {
        findings_problem(f, name, "the mesh that was chosen, %s, is not in the bundle", name);
        mem_free(*found);
        *found = NULL;
    }
}

enum status mesh_choose(const struct mesh_choice *choice, char **found, struct findings *f, struct error *err) {
    const struct frames *t = choice->transforms;
    const char *root = choice->listing->root;
    *found = NULL;
    if (choice->wanted) {
        take_wanted(choice, found, f);
        return STATUS_OK;
    }
    if (t->mesh && !file_is_in(root, t->mesh)) {
        findings_problem(f, choice->match->found, "\"mesh\" names %s, which is not in the bundle", t->mesh);
        return STATUS_OK;
    }
    const char *named = t->mesh ? t->mesh : t->point_cloud && file_is_in(root, t->point_cloud) ? t->point_cloud : NULL;
    bool is_mesh = t->mesh != NULL;
    enum status status = STATUS_OK;
    if (named && !is_mesh) {
        char *path = file_join(root, named);
        status = mesh_file_has_faces(path, named, &is_mesh, err);
        mem_free(path);
    }
    if (status != STATUS_OK)
        return status;
    if (is_mesh) {
        *found = mem_strdup(named);
        return STATUS_OK;
    }
    return choose_among(choice, found, f, err);
}
