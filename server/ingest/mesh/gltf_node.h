/* gltf_node.h -- the transform of a glTF node (glTF 2.0 specification, 3.5.3), and of the instances of its mesh
 * (EXT_mesh_gpu_instancing). */
#ifndef UNBAKE_INGEST_MESH_GLTF_NODE_H
#define UNBAKE_INGEST_MESH_GLTF_NODE_H

#include "server/ingest/mesh/gltf_file.h"

/* world = m p, row-major; the last row is 0 0 0 1. */
struct affine {
    double m[3][4];
};

/* a after b. */
struct affine affine_multiply(const struct affine *a, const struct affine *b);
/* Cofactor matrix (inverse transpose times determinant): transforms normals, and exists for singular matrices. */
void affine_cofactors(const struct affine *a, double c[3][3]);

/* From the node's frame to its parent's, by its matrix or its translation, rotation and scale. */
enum status gltf_node_transform(const struct gltf_file *g, size_t node, struct affine *t, struct error *err);

#define GLTF_MAX_INSTANCES ((size_t)1 << 20) /* of one node */

/* From each instance's frame to the node's: instance[count], the caller's (mem_free). `extension` is the node's
 * member. */
enum status gltf_node_instances(struct gltf_file *g, size_t node, const cJSON *extension, struct affine **instance,
                                size_t *count, struct error *err);

#endif
