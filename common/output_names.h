/* output_names.h -- names of a job's output files, by which one part of the program finds what another has written: the
 * export writes those of a reconstruction, renders and evaluations read them. Other outputs are read by people only. */
#ifndef UNBAKE_COMMON_OUTPUT_NAMES_H
#define UNBAKE_COMMON_OUTPUT_NAMES_H

#define OUTPUT_MESH "scene.ply"     /* every reconstruction leaves one */
#define OUTPUT_REPORT "report.json" /* settings, figures, segments and which of them emit */
#define OUTPUT_VIEWS "views.json"   /* cameras of the held-out views; of a render those of its pictures */
#define OUTPUT_CAMERAS "cameras.json"
#define OUTPUT_BASE_COLOR "base_color.exr"
#define OUTPUT_ROUGHNESS "roughness.exr"
#define OUTPUT_SPECULAR "specular.exr"
#define OUTPUT_EMISSION "emission.exr"
#define OUTPUT_CONFIDENCE "confidence.exr"   /* standard deviation of base colour */
#define OUTPUT_ENVIRONMENT "environment.exr" /* distant light; none where none was seen */
#define OUTPUT_SKY "sky.exr"                 /* the same without an inferred sun */

#define OUTPUT_RECORD "views.jsonl"         /* of a render: a line for each picture that is done */
#define OUTPUT_EVALUATION "evaluation.json" /* figures of an evaluation */

#endif
