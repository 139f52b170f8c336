/* input.h -- the input of all exporters: the recovered room and its report. */
#ifndef UNBAKE_EXPORT_INPUT_H
#define UNBAKE_EXPORT_INPUT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/image.h"
#include "common/json.h"
#include "common/parallel.h"
#include "server/scene/atlas.h"
#include "server/scene/camera.h"
#include "server/scene/inverse_uv.h"
#include "server/scene/materials.h"
#include "server/scene/mesh.h"
#include "server/scene/segment.h"

#define EXPORT_MARGIN 16         /* texels */
#define EXPORT_PREVIEW_SIZE 1024 /* texels */

/* A held-out view: photograph and re-render in linear radiance, R G B, of one size. */
struct export_comparison {
    const char *name;               /* the photograph's, for labels */
    const struct image *photograph; /* saturated and masked pixels unchanged */
    const struct image *render;
    const struct camera *camera; /* that took it */
};

/* A sun that no photograph shows. It is drawn in `environment`, too. */
struct export_sun {
    bool is_there;
    vec3 direction;   /* unit, towards its middle */
    float radius_rad; /* angular radius */
    rgb irradiance;   /* of a surface that faces it */
};

/* Where a photograph was taken from. */
struct export_camera {
    const char *name;     /* the photograph's */
    struct camera camera; /* of the picture in the file */
    bool is_held_out;
};

/* What the user chose of the files. */
struct export_options {
    bool bakes_uv;       /* also writes textures in the input's own texture coordinates, see uv_bake.h */
    bool glb_has_lights; /* scene.glb has stand-ins for lamps and sun, see glb_lights.h */
    bool glb_has_uv;     /* scene.glb shows these, where they could be made */
};

/* All borrowed. */
struct export_input {
    const char *title; /* the job's or the scene's name */
    const struct mesh *mesh;
    const struct segments *segments;
    const struct atlas *atlas;
    const struct inverse_uv *inverse;
    const struct materials *materials;
    const float *observation_count;             /* [height][width] photographs of each texel; NULL until known */
    const bool *is_emitter;                     /* [segment_count] */
    const struct image *environment;            /* R G B; NULL: no distant light */
    const struct image *environment_confidence; /* count, spread; NULL together with environment */
    size_t comparison_count;
    const struct export_comparison *comparison;
    /* An object. report.json is this plus "segments" (one entry each) and "files". The HTML page draws these members
     * if they exist, and shows all others as tables:
     *   "series": {"loss": [[step, value], ...], ...}   one curve each
     *   "stages": [{"name": "refine", "seconds": 12.3}, ...]
     *   "views":  [{"name": ..., "msre": ..., ...}, ...] in the order of `comparison` */
    const cJSON *report;
    vec3 up;                       /* the axis of the room that points up, see scene_up; 0: y */
    bool has_materials;            /* false: materials are only their neutral start, which no preview shows */
    const uint16_t (*radiance)[3]; /* [height][width] measured light, half precision; NULL while not known */
    struct export_sun sun;
    size_t camera_count;
    const struct export_camera *camera; /* of all photographs */
    double luminance_per_unit;          /* cd/m2 of radiance 1; 0: unknown */
    struct export_options options;
    struct parallel *pool;            /* may be NULL where there is no input's own layout */
    const struct export_input *baked; /* set by outputs.c: with atlas, inverse and materials in the input's own layout;
                                       * NULL: not made */
};

#endif
