/* results.c -- see results.h. */
#include "server/worker/results.h"

#include "common/mem.h"

struct export_input results_so_far(const struct reconstruction *r, const char *title) {
    const struct environment *e = &r->environment;
    return (struct export_input){
        .title = title,
        .mesh = &r->scene->mesh,
        .segments = &r->segments,
        .atlas = &r->atlas,
        .inverse = &r->inverse,
        .materials = &r->materials,
        .has_materials = r->has_materials,
        .radiance =
            r->radiance_preview ? (const uint16_t(*)[3])r->radiance_preview : (const uint16_t(*)[3])r->fused.radiance,
        .observation_count = r->fused.count,
        .is_emitter = r->is_emitter,
        .environment = e->map.pixel ? &e->map : NULL,
        .environment_confidence = e->map.pixel ? &e->confidence : NULL,
        .report = r->report,
        .up = scene_up(r->scene),
        .luminance_per_unit = r->luminance_per_unit,
        .sun = {r->sun.is_there, r->sun.direction, r->sun.radius_rad, r->sun.irradiance},
        .options = {.bakes_uv = settings_is(r->settings, "bake_uv", "auto"),
                    .glb_has_lights = settings_is(r->settings, "glb_lights", "on"),
                    .glb_has_uv = settings_is(r->settings, "glb_textures", "input")},
        .pool = r->pool,
    };
}

void results_make(struct export_input *input, const struct reconstruction *r, const char *title) {
    struct export_comparison *comparison = mem_array(r->held_out_count, sizeof *comparison);
    for (size_t i = 0; i < r->held_out_count; i++) {
        const struct held_out *view = &r->held_out[i];
        comparison[i] = (struct export_comparison){view->name, &view->photograph, &view->render, &view->camera};
    }
    struct export_camera *camera = mem_array(r->scene->photograph_count, sizeof *camera);
    for (size_t i = 0; i < r->scene->photograph_count; i++) {
        const struct photograph *p = &r->scene->photograph[i];
        camera[i] = (struct export_camera){p->name, photograph_file_camera(p), p->is_test};
    }
    *input = results_so_far(r, title);
    input->camera = camera;
    input->camera_count = r->scene->photograph_count;
    input->comparison = comparison;
    input->comparison_count = r->held_out_count;
}
