/* look.h -- what a mesh's file says of its surfaces: materials with factors and pictures, for meshes that are put into
 * a room. Rooms themselves are read without: their materials are what a reconstruction finds. */
#ifndef UNBAKE_INGEST_MESH_LOOK_H
#define UNBAKE_INGEST_MESH_LOOK_H

#include <stdbool.h>
#include <stddef.h>

#include "common/image.h"
#include "common/vec.h"
#include "server/ingest/mesh/faces.h"

enum look_wrap { LOOK_REPEAT, LOOK_CLAMP, LOOK_MIRROR };

/* A picture that multiplies a factor. */
struct look_map {
    bool is_there;
    size_t image;           /* of mesh_look.image */
    int channel;            /* of which the value is read; -1: red, green and blue */
    float turn[2][3];       /* the picture's u, v of (u, v, 1): v goes down from the first row, a picture is 1 x 1 */
    enum look_wrap wrap[2]; /* by u, v */
};

enum look_quantity { LOOK_BASE_COLOR, LOOK_EMISSION, LOOK_ROUGHNESS, LOOK_METALLIC, LOOK_QUANTITIES };

struct look_material {
    char *name;               /* "" where it has none; owned */
    bool is_own;              /* the file says what it is like; else it is neutral */
    rgb base_color, emission; /* emission: radiance */
    float roughness, metallic, specular;
    struct look_map map[LOOK_QUANTITIES];
};

struct look_image {
    char *name;         /* or number in the file; owned */
    bool is_color;      /* linear Rec. 709; else values as stored */
    struct image image; /* R G B, and A where there is one */
};

/* Something that materials have and that is not rendered. */
struct look_unread {
    char what[48];
    size_t count; /* materials */
};

#define LOOK_UNREAD_MAX 32 /* kinds of things */

struct mesh_look {
    size_t material_count;
    struct look_material *material; /* [material_count] owned; the mesh's object_id are their numbers */
    size_t image_count;
    struct look_image *image; /* [image_count] owned */
    size_t unread_count;
    struct look_unread unread[LOOK_UNREAD_MAX];
};

void look_release(struct mesh_look *look);

/* A material with the values of glTF 2.0's default one, but for its colour, .5; borrowed until the next. */
struct look_material *look_add(struct mesh_look *look, const char *name);

/* Counts something that is not rendered; once for a material. */
void look_leave_out(struct mesh_look *look, const char *what);
/* Tells it in the report, as one note. */
void look_note(const struct mesh_look *look, struct faces_report *report);

/* Reads an image, once for a name and kind (made linear where it is_color), from a file below a folder (NULL: none may
 * be read), as it was named in the file `of`. STATUS_INPUT: it cannot be. */
enum status look_read_image(struct mesh_look *look, const char *folder, const char *of, const char *name, bool is_color,
                            size_t *number, struct error *err);

/* The same of bytes, which have the name. */
enum status look_read_bytes(struct mesh_look *look, const char *name, const void *data, size_t size, bool is_color,
                            size_t *number, struct error *err);

/* Whether a material of the look has a picture. */
bool look_has_maps(const struct mesh_look *look);

/* The value at texture coordinates: bilinear, r = g = b of one channel. */
rgb look_map_value(const struct mesh_look *look, const struct look_map *map, vec2 uv);

/* Specular of a dielectric by its reflectance at normal incidence, 0 to .08. */
static inline float look_specular(float reflectance) { return reflectance / 0.08f; }

#endif
