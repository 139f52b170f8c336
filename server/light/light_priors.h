/* light_priors.h -- what every estimate of light assumes of a room before it looks at it, each named once.
 *
 * *_DEVIATION and the like are standard deviations of natural logarithms: .7 is a factor of two. Of the room: the
 * median radiance that photographs show. README.md says how far results move with them. */
#ifndef UNBAKE_LIGHT_LIGHT_PRIORS_H
#define UNBAKE_LIGHT_LIGHT_PRIORS_H

/* --- base colour ------------------------------------------------------------------------------------------- */

/* Of a segment. Recommended reflectances of interiors are .2 for floors, .5 for walls, .8 for ceilings (EN 12464-1). */
#define ALBEDO_MEAN 0.4
#define ALBEDO_DEVIATION 0.7

/* Of white paint. Errors of known light have a part that is common to all, hence the deviation. */
#define ALBEDO_WHITE 0.85
#define ALBEDO_WHITE_DEVIATION 0.15

/* About the segment: of points about their patch, by texture; of a patch, by texture and light that is not modelled,
 * which also bounds how far it exceeds white paint. */
#define ALBEDO_POINT 0.25
#define ALBEDO_PATCH 0.15

/* What a highlight that is not known yet may add to albedo: the normal reflectance of dielectrics. */
#define ALBEDO_HIGHLIGHT 0.04f

/* --- radiance of sources ----------------------------------------------------------------------------------- */

/* Of which no more is known than a lower bound, or the room: a factor of seven. */
#define LIGHT_UNKNOWN_DEVIATION 2.0

/* A hidden lamp over the room: luminous panels and shades have 30 to 1,000 times the luminance of walls. */
#define LAMP_OVER_ROOM 100.0
#define LAMP_DEVIATION 1.5

/* A lamp that photographs measure: observed directly they are off by 1 to 6 %, small ones by up to 16 %. Lamps whose
 * observed radiances differ by less look alike. */
#define SEEN_DEVIATION 0.1

/* An opening of a scan over the room: most of what lies behind is dark, or no brighter than the room, some are
 * lamps. */
#define OPENING_OVER_ROOM 0.1

/* What is filled in, of the sky and of surfaces that no photograph shows: right within a factor of two. */
#define FILL_DEVIATION 0.7
/* Of the sky where unseen_fit.h fitted it to surfaces. */
#define FIT_DEVIATION 0.3

/* Ground over sky: ground reflects .2 of what falls on it, houses .3 to .5; overcast sky is a third as bright at the
 * horizon as above, and under a sun the ground is as bright as the sky. As far as what is filled in. */
#define GROUND_OVER_SKY 0.4

/* A channel about the mean of the channels: black bodies of 2,700 K and 6,500 K are .5 off in blue, coloured lamps
 * twice as much. And one that photographs measure, by noise. */
#define COLOR_DEVIATION 1.0
#define MEASURED_DEVIATION 0.02

/* Odds that are asked of a lamp, or of a sun, that is found by what it lights: a false one costs more than a missed
 * one. */
#define SURE 20.0

/* --- what the model lacks ---------------------------------------------------------------------------------- */

/* Light that is not modelled, a standard deviation as a part of the room: dim places say less. */
#define DARK_DEVIATION 0.05f

/* Of a lamp, beside the posterior's own deviation: with it errors of nine hidden lamps of the rooms for choices are .83
 * of what is stated, root of the mean square. Nearly all are upwards. */
#define SYSTEMATIC_DEVIATION 0.15

#endif
