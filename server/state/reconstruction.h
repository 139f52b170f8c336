/* reconstruction.h -- the state that the stages share. */
#ifndef UNBAKE_STATE_RECONSTRUCTION_H
#define UNBAKE_STATE_RECONSTRUCTION_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/json.h"
#include "common/parallel.h"
#include "common/settings.h"
#include "server/capture/distant/environment.h"
#include "server/capture/fuse.h"
#include "server/capture/grey_card.h"
#include "server/gather/sun.h"
#include "server/render/world.h"
#include "server/scene/inverse_uv.h"
#include "server/scene/materials.h"
#include "server/scene/scene.h"
#include "server/state/estimated_light.h"
#include "server/state/evidence.h"
#include "server/state/hooks.h"
#include "server/state/plan.h"

/* A held-out photograph and its re-render. */
struct held_out {
    const char *name;                           /* borrowed from the scene */
    uint32_t step;                              /* camera_step */
    struct camera camera;                       /* of the view: the photograph's, or a smaller one */
    struct image photograph, render;            /* linear radiance, R G B, of one size; owned */
    uint32_t samples;                           /* paths for each pixel */
    double msre, psnr_db, ssim;                 /* free of the re-render's noise */
    double msre_noise_left, psnr_noise_left_db; /* standard errors by it */
    double msre_render_noise;                   /* what it would add to msre, in the mean */
    double msre_photograph_noise;               /* what the photograph's noise adds */
    double msre_at_outlines, outline_share;     /* part of msre and of the pixels that lie beside outlines */
    double brightness_error;                    /* squared, of the whole view, relative (metrics_brightness_error) */
};

/* Segments from `first` on. */
struct segment_range {
    size_t first, count;
};

static inline bool segment_range_has(const struct segment_range *range, size_t segment) {
    return segment >= range->first && segment - range->first < range->count;
}

struct reconstruction {
    struct scene *scene;             /* borrowed */
    const struct settings *settings; /* borrowed */
    struct plan plan;                /* of work and time (pace.h) */
    char left_out[512];              /* what a time limit left out, as a sentence; "": nothing */
    bool has_materials;              /* materials are not the initial ones */
    struct parallel *pool;           /* borrowed */
    float mesh_noise_m; /* standard deviation of a scan's vertices (mesh_denoise.h); 0: modelled, or not denoised */
    struct segments segments;
    struct atlas atlas;
    struct inverse_uv inverse;
    struct materials materials;
    struct world world;
    struct environment environment; /* distant light; map.pixel is NULL where no photograph shows any */
    rgb sky_factor;                 /* by which solve brightened its saturated directions, in checkpoints of format 2 */
    struct estimated_light light;   /* sources that are inferred from what they light */
    struct sun sun;                 /* a sun that no photograph shows */
    double unseen_share;            /* part of the rays from surfaces that meet nothing observed */
    bool exposures_drift, colors_drift; /* given exposures, white balance (calibrate.h) */
    bool is_surrounded;                 /* holes of the scan were filled, and what is left open shows no sky */
    struct segment_range openings;      /* segments that openings.h added */
    struct segment_range unseen_lamps;  /* that unseen_lamps.h added */
    bool sky_is_fitted;                 /* unobserved sky was fitted to surfaces (unseen_light.h), not filled in */
    struct grey_card grey_card;         /* a point of known reflectance */
    double luminance_per_unit;          /* cd/m2 of radiance 1, once reported; 0: unknown */
    struct noise noise;                 /* of the photographs' pixels */
    uint16_t (*radiance_preview)[3]; /* [height][width] a first picture of that (radiance_preview.h), or NULL; owned */
    struct fused fused;              /* observed radiance of each texel */
    bool *is_emitter;                /* [segment_count]; owned */
    struct emitter_evidence *evidence; /* [segment_count] evidence for it; owned */
    size_t held_out_count;
    struct held_out *held_out; /* [held_out_count]; owned */
    cJSON *report;             /* object, filled by the stages; owned */
};

/* How far edges of the mesh may be off; 0 where its noise is not known. On a scan fused at 1.5 cm the noise of vertices
 * is a tenth of a voxel, and edges are rounded over three to four. */
static inline float reconstruction_edge_m(const struct reconstruction *r) { return 30.0f * r->mesh_noise_m; }

/* The surface, for functions that need nothing else of the state; valid as long as r. */
static inline struct surface reconstruction_surface(const struct reconstruction *r) {
    return (struct surface){&r->scene->mesh, &r->segments, &r->atlas, &r->inverse};
}

/* The segment of a valid texel. */
static inline uint32_t reconstruction_segment(const struct reconstruction *r, uint32_t texel) {
    return r->segments.of_triangle[r->inverse.triangle[texel]];
}

#endif
