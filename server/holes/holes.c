/* holes.c -- see holes.h. */
#include "server/holes/holes.h"

#include "server/holes/hidden_holes.h"
#include "server/holes/hole_surface.h"

#define LEAST_LISTED 4 /* cells of a region that the report has */

static bool any_open(const struct views *views) {
    for (uint32_t t = 0; t < views->train_count; t++) {
        const struct camera *camera = &views->scene->photograph[views->train[t]].camera;
        size_t count = (size_t)camera->width * camera->height;
        views_use(views, t, 0, count);
        for (size_t k = 0; k < count; k++) {
            if (views->shows[t][k] == VIEWS_OPEN)
                return true;
        }
    }
    return false;
}

static void list_region(struct holes_found *found, const struct hole_grid *grid, const struct hole_region *region,
                        bool is_filled) {
    const struct hole_plane *plane = hole_grid_plane(grid, region->first_cell);
    if (region->cells < LEAST_LISTED)
        return;
    uint32_t number = region->first_cell - plane->first;
    vec3 at = hole_plane_corner(grid, plane, number % plane->columns, number / plane->columns);
    cJSON *entry = cJSON_CreateObject();
    json_add_bool(entry, "filled", is_filled);
    json_add_bool(entry, "hidden", region->is_hidden);
    json_add(entry, "place", cJSON_CreateDoubleArray((double[]){(double)at.x, (double)at.y, (double)at.z}, 3));
    json_add_number(entry, "m2", region->cells * (double)grid->side_m * (double)grid->side_m);
    json_add_int(entry, "pixels", (int64_t)region->observations);
    json_add_number(entry, "variance_here", region->here.variance);
    json_add_number(entry, "variance_far_away", region->away.variance);
    json_add_number(entry, "variance_beside", region->beside);
    json_add_number(entry, "step_across_rim", region->step);
    json_add_number(entry, "step_beside_rim", region->usual_step);
    cJSON_AddItemToArray(found->list, entry);
}

static void report(struct holes_found *found, const struct hole_grid *grid, const struct hole_regions *holes,
                   const struct hole_regions *kept) {
    double cell_m2 = (double)grid->side_m * (double)grid->side_m;
    found->list = cJSON_CreateArray();
    found->filled = holes->count;
    found->kept = kept->count;
    for (size_t i = 0; i < holes->count; i++) {
        found->filled_m2 += cell_m2 * holes->region[i].cells;
        list_region(found, grid, &holes->region[i], true);
    }
    for (size_t i = 0; i < kept->count; i++) {
        found->kept_m2 += cell_m2 * kept->region[i].cells;
        list_region(found, grid, &kept->region[i], false);
    }
}

void holes_fill(struct scene *scene, struct segments *segments, const struct views *views,
                const struct holes_wanted *wanted, struct parallel *pool, struct holes_found *found) {
    struct hole_grid grid;
    struct hole_observations observations;
    struct hole_regions holes, kept;
    *found = (struct holes_found){0};
    if (!any_open(views))
        return;
    hole_grid_init(&grid, &scene->mesh, views->accel, wanted->within, pool);
    hole_observations_take(&observations, &grid, views, pool);
    hole_regions_find(&holes, &kept, &grid, &observations, wanted->fills_all);
    if (wanted->fills_hidden)
        hidden_holes_add(&holes, &grid, &scene->mesh, views->accel);
    report(found, &grid, &holes, &kept);
    found->triangles = hole_surface_add(&scene->mesh, segments, &grid, &holes);
    hole_regions_release(&kept);
    hole_regions_release(&holes);
    hole_observations_release(&observations);
    hole_grid_release(&grid);
}
