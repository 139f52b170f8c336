/* hole_observations.c -- see hole_observations.h. */
#include "server/holes/hole_observations.h"

#include "common/mem.h"
#include "common/quantile.h"

/* Pixels that are looked at: of a photograph, 320 x 240, which has a cell in a few; of all, for time and memory. */
#define PIXELS 80000.0
#define ALL_PIXELS 1e7
/* Radiance, as a share of the photographs' median, below which a pixel shows nothing: a surface as dark adds a
 * hundredth to the light that it takes away. Also what logarithms are taken after it is added, so that they are
 * finite. */
#define DARK_SHARE 0.01f
#define LIKE_COSINE 0.7f /* between the normals of a plane and of a surface in it */

#define LEAST_PHOTOGRAPHS 4 /* of a cell whose variance counts */

/* What a pixel shows. */
struct hole_pixel {
    vec3 direction, normal; /* of the ray; of the surface */
    float distance_m;       /* infinite: nothing */
    float radiance;
    bool is_known, is_saturated;
};

struct look_job {
    const struct views *views;
    uint32_t train;
    const struct photograph *photo;
    uint32_t step, columns;
    struct hole_pixel *pixel; /* [rows][columns] */
};

/* Whether a pixel tells of what it passes: one in STRIDE squared does. */
static bool passes(size_t column, size_t row) { return column % HOLE_PASS_STRIDE == 0 && row % HOLE_PASS_STRIDE == 0; }

static void look_at_pixel(const struct look_job *job, uint32_t column, uint32_t row, struct hole_pixel *pixel) {
    const struct camera *camera = &job->photo->camera;
    size_t at = (size_t)(row * job->step) * camera->width + column * job->step;
    float x = (float)(column * job->step) + 0.5f, y = (float)(row * job->step) + 0.5f;
    struct photograph_sample sample;
    struct accel_hit hit;
    views_use(job->views, job->train, at, 1);
    bool is_open = job->views->shows[job->train][at] == VIEWS_OPEN;
    *pixel = (struct hole_pixel){.distance_m = INFINITY};
    if ((!is_open && !passes(column, row)) || !camera_direction(camera, x, y, &pixel->direction) ||
        !photograph_sample(job->photo, x, y, &sample))
        return;
    pixel->is_saturated = photograph_sample_saturates(&sample);
    pixel->radiance = fmaxf(rgb_mean(sample.radiance), 0.0f);
    pixel->is_known = is_open;
    if (is_open || !accel_intersect(job->views->accel, camera_origin(camera), pixel->direction, 0.0f, INFINITY, &hit))
        return;
    pixel->is_known = true;
    pixel->distance_m = hit.distance_m;
    pixel->normal = vec3_normalize(mesh_cross(&job->views->scene->mesh, hit.triangle));
}

static void look_at_row(void *user, size_t row, int thread) {
    const struct look_job *job = user;
    (void)thread;
    for (uint32_t column = 0; column < job->columns; column++)
        look_at_pixel(job, column, (uint32_t)row, &job->pixel[row * job->columns + column]);
}

/* What a pixel says of a plane's cells: it passes those before what it meets, and sees the one that this lies in. */
static void tell_plane(struct hole_grid *grid, size_t number, vec3 origin, const struct hole_pixel *pixel,
                       float value) {
    const struct room_plane *plane = &grid->plane[number].plane;
    float distance_m;
    uint32_t at = hole_grid_meet(grid, number, origin, pixel->direction, &distance_m);
    if (at == HOLE_NO_CELL)
        return;
    struct hole_cell *cell = &grid->cell[at];
    if (!isfinite(pixel->distance_m)) {
        cell->passed++;
        return;
    }
    float height = room_plane_height(plane, vec3_mad(origin, pixel->distance_m, pixel->direction));
    if (fabsf(height) < 0.5f * grid->side_m && vec3_dot(pixel->normal, plane->normal) > LIKE_COSINE) {
        if (!pixel->is_saturated)
            hole_mean_add(&cell->surface, value);
    } else if (height < -0.5f * grid->side_m && distance_m < pixel->distance_m) {
        cell->passed++;
    }
}

static void add_observation(struct hole_observations *observations, size_t *capacity,
                            const struct hole_observation *observation) {
    if (observations->count == *capacity) {
        *capacity = 2 * *capacity + 4096;
        observations->item = mem_realloc_array(observations->item, *capacity, sizeof *observations->item);
    }
    observations->item[observations->count++] = *observation;
}

static void close_surfaces(struct hole_grid *grid) {
    for (uint32_t i = 0; i < grid->cell_count; i++)
        hole_mean_close(&grid->cell[i].surface);
}

static void take_photograph(struct hole_observations *observations, size_t *capacity, struct hole_grid *grid,
                            uint32_t train, struct parallel *pool) {
    const struct views *views = observations->views;
    const struct photograph *photo = &views->scene->photograph[views->train[train]];
    double pixels = (double)photo->camera.width * photo->camera.height;
    uint32_t step = (uint32_t)fmax(1.0, ceil(sqrt(pixels / fmin(PIXELS, ALL_PIXELS / (double)views->train_count))));
    uint32_t columns = (photo->camera.width + step - 1) / step, rows = (photo->camera.height + step - 1) / step;
    struct look_job job = {views, train, photo, step, columns, mem_array((size_t)columns * rows, sizeof *job.pixel)};
    vec3 origin = camera_origin(&photo->camera);
    float dark = DARK_SHARE * views->median_radiance;
    parallel_for(pool, rows, look_at_row, &job);
    for (size_t i = 0; i < (size_t)columns * rows; i++) {
        const struct hole_pixel *pixel = &job.pixel[i];
        float value = logf(pixel->radiance + dark);
        if (!pixel->is_known)
            continue;
        if (!isfinite(pixel->distance_m) && pixel->radiance > dark)
            add_observation(
                observations, capacity,
                &(struct hole_observation){pixel->direction, value, train, HOLE_NO_CELL, pixel->is_saturated, false});
        else if (passes(i % columns, i / columns))
            for (size_t k = 0; k < grid->plane_count; k++)
                tell_plane(grid, k, origin, pixel, value);
    }
    close_surfaces(grid);
    mem_free(job.pixel);
}

/* The median over covered cells. */
static double variance_of(const struct hole_grid *grid, const struct hole_plane *plane) {
    float *variance = mem_array((size_t)plane->columns * plane->rows + 1, sizeof *variance);
    size_t count = 0;
    for (uint32_t i = plane->first; i < plane->first + plane->columns * plane->rows; i++) {
        const struct hole_mean *m = &grid->cell[i].surface;
        if (m->photographs >= LEAST_PHOTOGRAPHS)
            variance[count++] = (float)(hole_mean_scatter(m) / (m->photographs - 1));
    }
    double middle = (double)quantile(variance, count, 0.5);
    mem_free(variance);
    return fmax(middle, HOLE_LEAST_VARIANCE);
}

void hole_observations_take(struct hole_observations *observations, struct hole_grid *grid, const struct views *views,
                            struct parallel *pool) {
    size_t capacity = 0;
    *observations = (struct hole_observations){.views = views};
    for (uint32_t t = 0; t < views->train_count; t++)
        take_photograph(observations, &capacity, grid, t, pool);
    for (size_t k = 0; k < grid->plane_count; k++)
        grid->plane[k].variance = variance_of(grid, &grid->plane[k]);
}

void hole_observations_release(struct hole_observations *observations) {
    mem_free(observations->item);
    *observations = (struct hole_observations){0};
}

static uint32_t nearest_cell(const struct hole_observations *observations, const struct hole_observation *observation,
                             const struct hole_grid *grid) {
    vec3 origin = hole_observation_origin(observations, observation);
    float nearest_m = INFINITY, distance_m;
    uint32_t nearest = HOLE_NO_CELL;
    for (size_t k = 0; k < grid->plane_count; k++) {
        uint32_t cell = hole_grid_meet(grid, k, origin, observation->direction, &distance_m);
        if (cell != HOLE_NO_CELL && !grid->cell[cell].is_refused && distance_m < nearest_m) {
            nearest_m = distance_m;
            nearest = cell;
        }
    }
    return nearest;
}

/* Cells are refused for good: an observation stays with its cell until that is, and one that has none left gets none
 * again. */
static void assign(struct hole_observation *observation, const struct hole_observations *observations,
                   const struct hole_grid *grid) {
    bool has_cell = observation->cell != HOLE_NO_CELL && !grid->cell[observation->cell].is_refused;
    if (has_cell || observation->is_out)
        return;
    observation->cell = nearest_cell(observations, observation, grid);
    observation->is_out = observation->cell == HOLE_NO_CELL;
}

void hole_observations_assign(struct hole_observations *observations, struct hole_grid *grid) {
    for (uint32_t i = 0; i < grid->cell_count; i++) {
        if (grid->cell[i].opened > 0)
            grid->cell[i].open = (struct hole_mean){0};
        grid->cell[i].opened = 0;
    }
    for (size_t i = 0, end; i < observations->count; i = end) {
        for (end = i; end < observations->count && observations->item[end].train == observations->item[i].train;
             end++) {
            struct hole_observation *observation = &observations->item[end];
            assign(observation, observations, grid);
            if (observation->cell == HOLE_NO_CELL)
                continue;
            if (!observation->is_saturated)
                hole_mean_add(&grid->cell[observation->cell].open, observation->value);
            grid->cell[observation->cell].opened++;
        }
        for (size_t k = i; k < end; k++) {
            if (observations->item[k].cell != HOLE_NO_CELL)
                hole_mean_close(&grid->cell[observations->item[k].cell].open);
        }
    }
}
