/* light_finish.h -- colours and standard deviations of a joint fit's lamps. */
#ifndef UNBAKE_LIGHT_LIGHT_FINISH_H
#define UNBAKE_LIGHT_LIGHT_FINISH_H

#include "server/light/light_model.h"

/* Radiances of the lamps by channel, and deviations, from the fit's values; m->r->light.deviation. */
void light_finish(struct light_model *m);

#endif
