/* commands.h -- what each command does; one file a group. The table is in commands.c. */
#ifndef UNBAKE_CLIENT_COMMANDS_H
#define UNBAKE_CLIENT_COMMANDS_H

#include "client/client.h"

/* submit.c */
extern const struct command_option submit_options[];
int submit_run(struct client *c, const struct options *o);

/* compare.c */
extern const struct command_option compare_options[];
int compare_run(struct client *c, const struct options *o);

/* check.c */
extern const struct command_option check_options[];
int check_run(struct client *c, const struct options *o);
int check_set_run(struct client *c, const struct options *o); /* `scenes set` */

/* render.c */
extern const struct command_option render_options[], evaluate_options[];
int render_run(struct client *c, const struct options *o);
int evaluate_run(struct client *c, const struct options *o);

/* watch.c */
extern const struct command_option watch_options[], logs_options[];
int watch_run(struct client *c, const struct options *o);
int logs_run(struct client *c, const struct options *o);
/* Follows a job to its end. `all`: from its first event on, not from now. */
int watch_job(struct client *c, int64_t job, bool all);

/* wait.c */
extern const struct command_option wait_options[];
int wait_run(struct client *c, const struct options *o);

/* open.c */
extern const struct command_option open_options[];
int open_run(struct client *c, const struct options *o);

/* servers.c */
extern const struct command_option servers_options[];
int servers_run(struct client *c, const struct options *o);

/* jobs.c */
extern const struct command_option list_options[], show_options[], retry_options[], rm_options[];
int list_run(struct client *c, const struct options *o);
int show_run(struct client *c, const struct options *o);
int cancel_run(struct client *c, const struct options *o);
int pause_run(struct client *c, const struct options *o);
int redeliver_run(struct client *c, const struct options *o);
int resume_run(struct client *c, const struct options *o);
int retry_run(struct client *c, const struct options *o);
int rm_run(struct client *c, const struct options *o);

/* edit.c */
extern const struct command_option edit_options[], extend_options[];
int edit_run(struct client *c, const struct options *o);
int extend_run(struct client *c, const struct options *o);

/* get.c */
extern const struct command_option get_options[];
int get_run(struct client *c, const struct options *o);
/* All outputs of a job into the folder `dir`. */
int get_job(struct client *c, int64_t job, const char *dir);
/* Whether a name from the server may become a file below the folder asked for. */
bool get_name_is_safe(const char *name);

/* scenes.c */
int scenes_run(struct client *c, const struct options *o);

/* uploads.c */
extern const struct command_option collect_options[];
int uploads_run(struct client *c, const struct options *o);
int collect_run(struct client *c, const struct options *o);

/* login.c */
int login_run(struct client *c, const struct options *o);
int logout_run(struct client *c, const struct options *o);

/* manual.c */
int manual_run(struct client *c, const struct options *o);

/* about.c */
/* Appends what a setting, as settings_describe has it, may be: "64 to 16384 texels", "auto, given", "true, false"; and
 * its default. */
void setting_values(struct buf *out, const cJSON *setting);
void setting_default(struct buf *out, const cJSON *setting);
extern const struct command_option settings_options[], version_options[];
int settings_run(struct client *c, const struct options *o);
int version_run(struct client *c, const struct options *o);

#endif
