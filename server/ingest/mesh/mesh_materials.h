/* mesh_materials.h -- the materials that a mesh's file states, with factors and pictures: for meshes that are put into
 * a room. Rooms themselves are read without: their materials are what a reconstruction finds. */
#ifndef UNBAKE_INGEST_MESH_MESH_MATERIALS_H
#define UNBAKE_INGEST_MESH_MESH_MATERIALS_H

#include <stdbool.h>
#include <stddef.h>

#include "common/image.h"
#include "common/vec.h"
#include "server/ingest/mesh/faces.h"

enum material_wrap { MATERIAL_WRAP_REPEAT, MATERIAL_WRAP_CLAMP, MATERIAL_WRAP_MIRROR };

/* A picture that multiplies a factor. */
struct material_map {
    bool is_there;
    size_t image;     /* of mesh_materials.image */
    int channel;      /* of which the value is read; -1: red, green and blue */
    float turn[2][3]; /* the picture's u, v of (u, v, 1): v goes down from the first row, a picture is 1 x 1 */
    enum material_wrap wrap[2]; /* by u, v */
};

enum material_quantity {
    MATERIAL_BASE_COLOR,
    MATERIAL_EMISSION,
    MATERIAL_ROUGHNESS,
    MATERIAL_METALLIC,
    MATERIAL_QUANTITIES
};

struct mesh_material {
    char *name;               /* "" where it has none; owned */
    bool is_own;              /* the file says what it is like; else it is neutral */
    rgb base_color, emission; /* emission: radiance */
    float roughness, metallic, specular;
    struct material_map map[MATERIAL_QUANTITIES];
};

struct material_image {
    char *name;         /* or number in the file; owned */
    bool is_color;      /* linear Rec. 709; else values as stored */
    struct image image; /* R G B, and A where there is one */
};

/* Something that materials have and that is not rendered. */
struct material_unread {
    char what[48];
    size_t count; /* materials */
};

#define MATERIAL_UNREAD_MAX 32 /* kinds of things */

struct mesh_materials {
    size_t material_count;
    struct mesh_material *material; /* [material_count] owned; the mesh's object_id are their numbers */
    size_t image_count;
    struct material_image *image; /* [image_count] owned */
    size_t unread_count;
    struct material_unread unread[MATERIAL_UNREAD_MAX];
};

void mesh_materials_release(struct mesh_materials *materials);

/* A material with the values of glTF 2.0's default one, but for its colour, .5; borrowed until the next. */
struct mesh_material *mesh_materials_add(struct mesh_materials *materials, const char *name);

/* Counts something that is not rendered; once for a material. */
void mesh_materials_leave_out(struct mesh_materials *materials, const char *what);
/* Tells it in the report, as one note. */
void mesh_materials_note(const struct mesh_materials *materials, struct faces_report *report);

/* Reads an image, once for a name and kind (made linear where it is_color), from a file below a folder (NULL: none may
 * be read), as it was named in the file `of`. STATUS_INPUT: it cannot be. */
enum status mesh_materials_read_image(struct mesh_materials *materials, const char *folder, const char *of,
                                      const char *name, bool is_color, size_t *number, struct error *err);

/* The same of bytes, which have the name. */
enum status mesh_materials_read_bytes(struct mesh_materials *materials, const char *name, const void *data, size_t size,
                                      bool is_color, size_t *number, struct error *err);

/* Whether any material has a picture. */
bool mesh_materials_have_maps(const struct mesh_materials *materials);

/* The value at texture coordinates: bilinear, r = g = b of one channel. */
rgb material_map_value(const struct mesh_materials *materials, const struct material_map *map, vec2 uv);

/* Specular of a dielectric by its reflectance at normal incidence, 0 to .08. */
static inline float mesh_material_specular(float reflectance) { return reflectance / 0.08f; }

#endif
