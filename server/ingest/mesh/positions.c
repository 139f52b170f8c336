/* positions.c -- see positions.h. */
#include "server/ingest/mesh/positions.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/mem.h"

#define MIN_GAIN 4.0 /* two bits: of the step before the move over that after it */

void positions_append(struct positions *p, const double at[3]) {
    if (p->count == p->capacity) {
        p->capacity = p->capacity ? p->capacity + p->capacity / 2 : 1024;
        p->at = mem_realloc_array(p->at, p->capacity, sizeof *p->at);
    }
    memcpy(p->at[p->count++], at, sizeof *p->at);
}

void positions_release(struct positions *p) {
    mem_free(p->at);
    *p = (struct positions){0};
}

double positions_step(double coordinate) { return fabs(coordinate) * 0x1p-23; }

static double centre_of(double lower, double upper) {
    double farthest = fmax(fabs(lower), fabs(upper));
    double centre = round(0.5 * (lower + upper)), left = fmax(upper - centre, centre - lower);
    bool gains = MIN_GAIN * left <= farthest; /* false without a vertex */
    return positions_step(farthest) > POSITIONS_STEP_M && gains ? centre : 0.0;
}

/* Coordinates that are not finite do not count: if a triangle uses them, mesh_check refuses it. */
static void find_origin(const struct positions *p, const struct mesh *mesh, double origin[3]) {
    double lower[3] = {INFINITY, INFINITY, INFINITY}, upper[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        for (int c = 0; c < 3; c++) {
            const double *at = p->at[mesh->index[t][c]];
            for (int i = 0; i < 3; i++) {
                lower[i] = isfinite(at[i]) ? fmin(lower[i], at[i]) : lower[i];
                upper[i] = isfinite(at[i]) ? fmax(upper[i], at[i]) : upper[i];
            }
        }
    }
    for (int i = 0; i < 3; i++)
        origin[i] = centre_of(lower[i], upper[i]);
}

void positions_move_to_mesh(struct positions *p, struct mesh *mesh) {
    double origin[3];
    find_origin(p, mesh, origin);
    mesh->vertex_count = p->count;
    mesh->position = mem_array(p->count, sizeof *mesh->position);
    for (size_t v = 0; v < p->count; v++) {
        const double *at = p->at[v];
        mesh->position[v] =
            vec3_make((float)(at[0] - origin[0]), (float)(at[1] - origin[1]), (float)(at[2] - origin[2]));
    }
    for (int i = 0; i < 3; i++)
        mesh->offset[i] = p->offset[i] + origin[i];
    positions_release(p);
}

bool positions_read_offset(const char *comment, double offset[3]) {
    double at[3];
    int end = -1;
    if (sscanf(comment, " unbake offset %lf %lf %lf %n", &at[0], &at[1], &at[2], &end) != 3 || end < 0 ||
        comment[end] != '\0' || !isfinite(at[0] + at[1] + at[2]))
        return false;
    memcpy(offset, at, sizeof at);
    return true;
}
