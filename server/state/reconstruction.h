/* reconstruction.h -- the state that the stages hand on, and what they may ask of the surroundings. */
#ifndef UNBAKE_STATE_RECONSTRUCTION_H
#define UNBAKE_STATE_RECONSTRUCTION_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/json.h"
#include "common/parallel.h"
#include "common/settings.h"
#include "server/capture/environment.h"
#include "server/capture/fuse.h"
#include "server/gather/sun.h"
#include "server/render/world.h"
#include "server/scene/inverse_uv.h"
#include "server/scene/materials.h"
#include "server/scene/scene.h"
#include "server/state/plan.h"
#include "server/state/state_array.h"

/* Of a surface of which nothing is known, and of an emitter, whose own light hides it. */
#define NEUTRAL_BASE_COLOR 0.5f

struct reconstruction; /* the present state, for previews and outputs */
struct emitter_evidence;

/* What the surroundings offer. All are called from the thread that runs reconstruct_run. */
struct reconstruct_hooks {
    void *user;
    bool (*stop_requested)(void *user);
    void (*stage)(void *user, const char *stage);
    void (*progress)(void *user, const char *stage, double done, double total, double eta_sec);
    void (*metric)(void *user, const char *series, long step, double value);
    void (*log)(void *user, const char *message);
    void (*warning)(void *user, const char *message);
    /* Seconds that this attempt has really had, from its start: other processes' shares, stops and sleep of the machine
     * do not count. Nothing but forecasts and the time limit comes of it. */
    double (*worked_sec)(void *user);
    /* True when a checkpoint / preview is due (the surroundings keep the clock). */
    bool (*checkpoint_due)(void *user);
    bool (*preview_due)(void *user);
    /* Commits all arrays as the newest checkpoint, or fails and leaves the one before. */
    enum status (*checkpoint_save)(void *user, long iteration, const struct state_array *array,
                                   size_t count, struct error *err);
    /* Fills the arrays from the newest complete checkpoint; *found false and arrays untouched when there
     * is none. An array whose stored size differs is STATUS_CORRUPT. */
    enum status (*checkpoint_load)(void *user, struct state_array *array, size_t count, bool *found,
                                   struct error *err);
    enum status (*preview)(void *user, const struct reconstruction *r, struct error *err);
};

/* A held-out photograph and what the recovered room looks like from there. */
struct held_out {
    const char *name;                /* borrowed from the scene, both */
    const struct camera *camera;
    struct image photograph, render; /* linear radiance, R G B, of one size; owned */
    double msre, psnr_db, ssim;
    double msre_render_noise, msre_photograph_noise; /* about so much of msre is noise, each its part */
};

struct reconstruction {
    struct scene *scene;             /* borrowed */
    const struct settings *settings; /* borrowed */
    struct plan plan;                /* of work and time (pace.h) */
    char left_out[512];              /* what a time limit left out, as a sentence; "": nothing */
    bool has_materials;              /* materials are more than their neutral start */
    struct parallel *pool;           /* borrowed */
    struct segments segments;
    struct atlas atlas;
    struct inverse_uv inverse;
    struct materials materials;
    struct world world;
    struct environment environment;  /* distant light; map.pixel is NULL where no photograph looks out */
    rgb sky_factor;                  /* by which solve made saturated directions of it brighter still, or 1 */
    struct sun sun;                  /* that no photograph shows */
    double unseen_share;             /* of rays from surfaces: those that go where nothing is known */
    bool exposures_drift, colors_drift; /* told exposures, white balance (calibrate.h) */
    bool sky_is_fitted;              /* what comes from there is told by surfaces (unseen_light.h), not filled in */
    struct noise noise;              /* of the photographs' pixels */
    uint16_t (*radiance_preview)[3]; /* [height][width] a first picture of that (radiance_preview.h), or NULL; owned */
    struct fused fused;              /* what the photographs show of each texel */
    bool *is_emitter;                /* [segment_count]; owned */
    struct emitter_evidence *evidence; /* [segment_count] why; owned */
    size_t held_out_count;
    struct held_out *held_out;       /* [held_out_count]; owned */
    cJSON *report;                   /* object: figures of each stage, filled as they are known; owned */
};

/* The segment of a valid texel. */
static inline uint32_t reconstruction_segment(const struct reconstruction *r, uint32_t texel) {
    return r->segments.of_triangle[r->inverse.triangle[texel]];
}

#endif
