/* gltf_node.c -- see gltf_node.h. */
#include "server/ingest/mesh/gltf_node.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/mem.h"
#include "server/ingest/mesh/gltf_accessor.h"
#include "server/scene/coordinates.h"

struct affine affine_multiply(const struct affine *a, const struct affine *b) {
    struct affine c;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 4; j++)
            c.m[i][j] = a->m[i][0] * b->m[0][j] + a->m[i][1] * b->m[1][j] + a->m[i][2] * b->m[2][j] +
                        (j == 3 ? a->m[i][3] : 0.0);
    return c;
}

void affine_cofactors(const struct affine *a, double c[3][3]) {
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
            c[i][j] = a->m[i1][j1] * a->m[i2][j2] - a->m[i1][j2] * a->m[i2][j1];
        }
    }
}

/* `count` finite numbers, or the fallback's when the member is absent. */
static enum status read_numbers(const struct gltf_file *g, size_t node, const char *key, int count,
                                const double *fallback, double *value, struct error *err) {
    const cJSON *array = cJSON_GetObjectItemCaseSensitive(g->nodes.item[node], key), *item;
    int i = 0;
    memcpy(value, fallback, (size_t)count * sizeof *value);
    if (!array)
        return STATUS_OK;
    bool good = cJSON_GetArraySize(array) == count;
    cJSON_ArrayForEach(item, array) {
        good = good && cJSON_IsNumber(item) && isfinite(item->valuedouble);
        if (good)
            value[i++] = item->valuedouble;
    }
    if (good)
        return STATUS_OK;
    return error_set(err, STATUS_INPUT, "%s: nodes[%zu].%s is not %d numbers", g->name, node, key, count);
}

/* Scaled, then turned by the unit quaternion x y z w, then moved. */
static struct affine compose(const double move[3], const double q[4], const double scale[3]) {
    double turn[3][3];
    struct affine t;
    coordinates_rotation((const double[4]){q[3], q[0], q[1], q[2]}, turn);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 4; j++)
            t.m[i][j] = j < 3 ? turn[i][j] * scale[j] : move[i];
    return t;
}

enum status gltf_node_transform(const struct gltf_file *g, size_t node, struct affine *t, struct error *err) {
    static const double identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    static const double none[4] = {0, 0, 0, 1}, one[3] = {1, 1, 1};
    double matrix[16], move[3], q[4], scale[3];
    enum status status = read_numbers(g, node, "matrix", 16, identity, matrix, err);
    if (status == STATUS_OK)
        status = read_numbers(g, node, "translation", 3, none, move, err);
    if (status == STATUS_OK)
        status = read_numbers(g, node, "rotation", 4, none, q, err);
    if (status == STATUS_OK)
        status = read_numbers(g, node, "scale", 3, one, scale, err);
    if (status != STATUS_OK)
        return status;
    struct affine trs = compose(move, q, scale), columns;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 4; j++)
            columns.m[i][j] = matrix[4 * j + i];
    *t = affine_multiply(&columns, &trs); /* a node has either a matrix or TRS */
    return STATUS_OK;
}

/* --- EXT_mesh_gpu_instancing ------------------------------------------------------------------ */

enum { INSTANCE_TRANSLATION, INSTANCE_ROTATION, INSTANCE_SCALE, INSTANCE_PARTS };

/* The attributes that the instances have; all of them must be of one length, *count. */
static enum status open_instances(struct gltf_file *g, size_t node, const cJSON *extension,
                                  struct gltf_span span[INSTANCE_PARTS], size_t *count, struct error *err) {
    static const char *const key[INSTANCE_PARTS] = {"TRANSLATION", "ROTATION", "SCALE"};
    static const char *const type[INSTANCE_PARTS] = {"VEC3", "VEC4", "VEC3"};
    const cJSON *attributes = cJSON_GetObjectItemCaseSensitive(extension, "attributes");
    char where[64];
    enum status status = STATUS_OK;
    *count = 0;
    snprintf(where, sizeof where, "nodes[%zu].EXT_mesh_gpu_instancing", node);
    for (int i = 0; i < INSTANCE_PARTS && status == STATUS_OK; i++) {
        bool found;
        size_t accessor;
        status = gltf_index(g, attributes, key[i], where, &g->accessors, &found, &accessor, err);
        if (status == STATUS_OK && found)
            status = gltf_span(g, accessor, type[i], &span[i], err);
        if (status == STATUS_OK && found && *count > 0 && span[i].count != *count)
            status = error_set(err, STATUS_INPUT, "%s: the attributes of %s are %zu and %zu", g->name, where, *count,
                               span[i].count);
        if (status == STATUS_OK && found)
            *count = span[i].count;
    }
    if (status == STATUS_OK && *count == 0)
        status = error_set(err, STATUS_INPUT, "%s: %s has no TRANSLATION, ROTATION or SCALE", g->name, where);
    if (status == STATUS_OK && *count > GLTF_MAX_INSTANCES)
        status = error_set(err, STATUS_LIMIT, "%s: %s has %zu instances, the limit is %zu", g->name, where, *count,
                           GLTF_MAX_INSTANCES);
    return status;
}

enum status gltf_node_instances(struct gltf_file *g, size_t node, const cJSON *extension, struct affine **instance,
                                size_t *count, struct error *err) {
    struct gltf_span span[INSTANCE_PARTS] = {{0}};
    *instance = NULL;
    enum status status = open_instances(g, node, extension, span, count, err);
    if (status == STATUS_OK)
        *instance = mem_array(*count, sizeof **instance);
    for (size_t i = 0; i < *count && status == STATUS_OK; i++) {
        double move[3] = {0, 0, 0}, q[4] = {0, 0, 0, 1}, scale[3] = {1, 1, 1};
        if (span[INSTANCE_TRANSLATION].data)
            gltf_read_vector(&span[INSTANCE_TRANSLATION], i, 3, move);
        if (span[INSTANCE_ROTATION].data)
            gltf_read_vector(&span[INSTANCE_ROTATION], i, 4, q);
        if (span[INSTANCE_SCALE].data)
            gltf_read_vector(&span[INSTANCE_SCALE], i, 3, scale);
        double length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
        for (int k = 0; k < 4 && length > 0.0; k++) /* integers are not quite of unit length */
            q[k] /= length;
        (*instance)[i] = compose(move, q, scale);
    }
    for (int i = 0; i < INSTANCE_PARTS; i++)
        gltf_span_release(&span[i]);
    return status;
}
