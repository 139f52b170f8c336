/* exr_layers.h -- finds the picture among the layers of an EXR part. Private to the codec. */
#ifndef UNBAKE_COMMON_EXR_LAYERS_H
#define UNBAKE_COMMON_EXR_LAYERS_H

#include "common/exr_stream.h"

/* Worst rank, for a part without colours. */
#define EXR_NO_COLOR 5

/* Channels of a part that are the picture; indices in its list, -1: none. */
struct exr_colors {
    int index[4]; /* R, G, B, A */
    int rank;     /* how sure it is that they are the picture, 0 (certain) to EXR_NO_COLOR */
    int rival;    /* red channel of another layer that is as good a choice */
};

/* Layers as renderers name them: "R"; "r"; "ViewLayer.Combined.R" (Blender). `part` is the part's name, or NULL. */
void exr_find_colors(const exr_attr_chlist_t *list, const char *part, struct exr_colors *colors);

#endif
