/* quantile.h -- the value below which a share of a sample lies. */
#ifndef UNBAKE_COMMON_QUANTILE_H
#define UNBAKE_COMMON_QUANTILE_H

#include <stddef.h>

/* value[share x count] of the values in order, share in [0, 1]: .5 is the (upper) median. 0 when there is
 * none. Sorts the values; none may be NaN. */
float quantile(float *value, size_t count, double share);
double quantile_double(double *value, size_t count, double share);

#endif
