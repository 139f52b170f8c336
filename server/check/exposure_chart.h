/* exposure_chart.h -- exposure by frame: how bright each photograph is, and the exposure that its file tells. */
#ifndef UNBAKE_CHECK_EXPOSURE_CHART_H
#define UNBAKE_CHECK_EXPOSURE_CHART_H

#include "server/check/drawing.h"
#include "server/scene/scene.h"

struct exposure_range {
    double brightness_stops; /* between the darkest and the brightest photograph's median */
    double given_stops;      /* between the smallest and the largest exposure that is given; 0 if none is */
};

/* Frames from left to right; one stop is a grey line. Dots: log2 of `brightness` [photograph_count], the median of the
 * stored pixels. Line: log2 of the exposure that is given. Each about its own median. *drawing is the caller's
 * (drawing_release). */
struct exposure_range exposure_chart_draw(struct drawing *drawing, const struct scene *scene, const float *brightness);

#endif
