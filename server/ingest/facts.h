/* facts.h -- a summary of a scene, as the API shows it. */
#ifndef UNBAKE_INGEST_FACTS_H
#define UNBAKE_INGEST_FACTS_H

#include "common/json.h"
#include "server/scene/scene.h"

/* An object: counts of the mesh and the photographs, bounds, exposures, warnings; the caller's. */
cJSON *facts_of(const struct scene *scene);
/* Its warnings alone, an array; also of a bundle that could not be loaded. The caller's. */
cJSON *facts_warnings(const struct scene *scene);

#endif
