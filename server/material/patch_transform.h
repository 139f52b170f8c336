/* patch_transform.h -- the cosine transform (type II, orthonormal) of square patches, and the window that they have.
 *
 * Windows of patches that are shifted by half of their side, squared, add up to one (Princen and Bradley 1986). */
#ifndef UNBAKE_MATERIAL_PATCH_TRANSFORM_H
#define UNBAKE_MATERIAL_PATCH_TRANSFORM_H

#define PATCH_SIDE 16 /* samples */
#define PATCH_SHIFT (PATCH_SIDE / 2)
#define PATCH_SIZE (PATCH_SIDE * PATCH_SIDE) /* samples, and coefficients: [row][column], [of columns][of rows] */
#define PATCH_LENGTHS (2 * PATCH_SIDE)

struct patch_basis {
    float cosine[PATCH_SIZE], transposed[PATCH_SIZE]; /* [frequency][sample], [sample][frequency] */
    float window[PATCH_SIDE];
    int length[PATCH_SIZE];         /* of a coefficient's frequency, rounded: below PATCH_LENGTHS */
    float octave_count[PATCH_SIZE]; /* how many coefficients share its octave, that of the greater frequency */
};

/* The one that there is; for any thread. */
const struct patch_basis *patch_basis(void);

/* In place. */
void patch_transform(const struct patch_basis *basis, float patch[PATCH_SIZE]);
void patch_transform_back(const struct patch_basis *basis, float patch[PATCH_SIZE]);

#endif
