/* commands.c -- the table of commands, and the help that is made from it.
 *
 * The table is not in main.c so that a test can read it. */
#include "client/commands.h"

#include <string.h>

#include "client/collection.h"
#include "common/protocol.h"
#include "common/render_settings.h"

#define ANY_NUMBER ((size_t)-1) /* of words */

static const struct command_option no_options[] = {{0}};

const struct command_option command_shared_options[] = {
    {"server", 0, OPTION_TEXT, "URL|NAME",
     "where unbaked listens, or a name of ~/.config/unbake/config; else $UNBAKE_SERVER, else that file's, else " PROTOCOL_DEFAULT_SERVER},
    {"ca", 0, OPTION_TEXT, "FILE", "certificates (PEM) to trust for https; else $UNBAKE_CA, else the system's"},
    {"json", 0, OPTION_FLAG, NULL, "print JSON, also for errors (those go to stderr)"},
    {"quiet", 'q', OPTION_FLAG, NULL, "print only results: no progress, no remarks"},
    {"retry", 0, OPTION_SECONDS, "SEC",
     "how long to retry an unreachable server (3; fetching 60, watching and sending 600)"},
    {"help", 'h', OPTION_FLAG, NULL, "print this help"},
    {0},
};

static const struct command table[] = {
    {"submit", "ROOM...", "upload rooms and queue a job on each",
     "ROOM is a folder or an archive (.zip, .tar, .tar.gz, .tar.zst) with a mesh, photographs and\n"
     "their cameras. A folder is packed on the fly; hidden files are left out. A room that the\n"
     "server has already is not sent again. With --scene no ROOM is needed. The server checks the room first; a job\n"
     "on one whose mesh and photographs do not fit is refused, unless it is told --set fit=ignore.\n\n"
     "--matrix KEY=A,B queues a job for each value; with several, for each combination. Jobs that are submitted\n"
     "together have the label `group`; `list --label` and `compare` take it. With --label group=NAME of your own the\n"
     "same command may be repeated: it queues what is not there yet. A room that fails does not keep the others.\n",
     "  unbake submit living-room/ --watch\n"
     "  unbake submit room.zip --name kitchen --set texture_size=4096 --set seed=7\n"
     "  unbake submit --scene 3f2a91c0 --set quality=fine --priority 5\n"
     "  unbake submit rooms/* --label group=flat --matrix quality=draft,fine --matrix seed=1,2,3\n",
     0, ANY_NUMBER, submit_options, submit_run},
    {"check", "ROOM", "tell whether the server can work with a room, before any job",
     "The room is sent, once; its content is kept. Shows what was found, whether mesh and photographs fit and,\n"
     "where they do not, how they would. Ends with 4 when the room is rejected, with 6 when it does not fit.\n",
     "  unbake check living-room/ --pictures check\n  unbake check living-room/ --scene-set mesh_axes='x -z y'\n", 0, 1,
     check_options, check_run},
    {"render", "JOB", "render a reconstruction in another light",
     "JOB is a reconstruction that has succeeded; nothing of it is sent again. --set says anything of lights,\n"
     "environment, cameras, passes and format; the options below are short for some of it. Files that settings name\n"
     "(an environment map, a mesh, a transforms.json) are sent along. A small picture does not wait behind\n"
     "reconstructions.\n",
     "  unbake render 17 --lights off --sun 2026-06-21T15:00 --place 52.5,13.4 -o relit\n"
     "  unbake render 17 --remove 27,28 --environment sky.hdr --set environment_turn=90 --view all --watch\n"
     "  unbake render last --set light.27=off --set light.28=2,1.8,1.2 --set passes=radiance,depth --set format=exr\n",
     1, 1, render_options, render_run},
    {"evaluate", "JOB", "compare a reconstruction with the truth of its room",
     "The room must have come with it: truth/ beside its photographs, as `unbaked demo-room` writes it.\n",
     "  unbake evaluate 17 -o figures\n", 1, 1, evaluate_options, evaluate_run},
    {"list", "", "list jobs, newest first", "",
     "  unbake list\n  unbake list --state failed --limit 5\n  unbake list -o jsonl | jq -r '[.id, .name] | @tsv'\n"
     "  unbake cancel $(unbake list --label group=flat --limit 0 -q)\n",
     0, 0, list_options, list_run},
    {"compare", "JOB|LABEL...", "show jobs side by side: settings that differ, main figures",
     "A LABEL is KEY=VALUE, or KEY for all its values: of all jobs that have it. Figures are those of the held-out\n"
     "photographs (report.json), or of an evaluation; `-` is a setting that was not given. The time is from the first\n"
     "start to the end.\n",
     "  unbake compare group=flat\n  unbake compare 17 18 21 --json\n", 1, ANY_NUMBER, compare_options, compare_run},
    {"show", "JOB", "show one job: state, settings, outputs", "",
     "  unbake show 17\n  unbake show last -o json | jq .settings\n", 1, 1, show_options, show_run},
    {"watch", "JOB", "follow a job until it ends",
     "On a terminal one line shows stage, progress, numbers and time left; on a pipe a line is\n"
     "printed when something changes, and every 10 s. When the server restarts, watching\n"
     "continues. Ends with 0 when the job succeeded and 1 when it failed or was cancelled.\n"
     "--exec then runs a command with UNBAKE_JOB, UNBAKE_NAME, UNBAKE_STATE and UNBAKE_REASON in\n"
     "its environment.\n",
     "  unbake watch last\n  unbake watch 17 --exec 'notify-send \"$UNBAKE_NAME: $UNBAKE_STATE\"'\n  unbake watch 17 --json --all | jq -c 'select(.event == \"metric\").data'\n",
     1, 1, watch_options, watch_run},
    {"wait", "JOB...", "wait until jobs have ended, for scripts",
     "Ends with 0 when all have succeeded, with 1 when one has failed, else with 8 when one was cancelled, and with 9\n"
     "when --timeout was over before. A line is printed for each job as it ends. Jobs that are paused are waited for.\n",
     "  unbake wait 17 18 19 && unbake get 19\n  unbake wait last --timeout 3600 -q\n", 1, ANY_NUMBER, wait_options,
     wait_run},
    {"open", "[JOB]", "show a job's page in a browser",
     "Takes $BROWSER, else what the desktop opens web pages with. The address is printed, also where there is no browser.\n",
     "  unbake open last\n  unbake open 17 --print\n", 0, 1, open_options, open_run},
    {"logs", "JOB", "print the job's log", "", "  unbake logs 17\n  unbake logs last --follow\n", 1, 1, logs_options,
     logs_run},
    {"get", "JOB [NAME...]", "fetch a job's outputs, also while it runs",
     "Fetches all outputs, or those named; a NAME may be a pattern such as 'preview/*'. Files that\n"
     "are there already with the right SHA-256 are kept, and an interrupted fetch continues where it\n"
     "stopped (NAME.part). Each file gets its name only when its SHA-256 is right.\n",
     "  unbake get 17 -o room-textures\n  unbake get last base_color.exr 'preview/*'\n", 1, ANY_NUMBER, get_options,
     get_run},
    {"cancel", "JOB...", "end jobs for good", "", "  unbake cancel 17\n", 1, ANY_NUMBER, no_options, cancel_run},
    {"pause", "JOB...", "stop jobs after a checkpoint", "", "  unbake pause 17\n", 1, ANY_NUMBER, no_options,
     pause_run},
    {"resume", "JOB...", "queue paused jobs again; they resume from their checkpoints", "", "  unbake resume 17\n", 1,
     ANY_NUMBER, no_options, resume_run},
    {"retry", "JOB...", "queue failed or cancelled jobs again, with all their attempts",
     "They resume from their checkpoints. With --from, also jobs that succeeded: that stage and all\n"
     "after it run again. Stages are load, prepare, fuse, solve, refine, report and export.\n",
     "  unbake retry 17\n  unbake retry 17 --from report\n", 1, ANY_NUMBER, retry_options, retry_run},
    {"redeliver", "JOB...", "send the messages of jobs' webhooks again",
     "Queued messages are sent now; if there are none, one about the current state. `unbake show` shows the outcome.\n",
     "  unbake redeliver 17\n", 1, ANY_NUMBER, no_options, redeliver_run},
    {"extend", "JOB", "continue a job that has ended, beyond its limit",
     "It resumes from its checkpoint, which the server keeps for a while.\n",
     "  unbake extend 17 --looks 1000\n  unbake extend last --time 3600\n", 1, 1, extend_options, extend_run},
    {"edit", "JOB...", "change the name, priority, labels, place in the queue or time of removal", "",
     "  unbake edit 17 --priority 10\n  unbake edit 17 --before 12\n  unbake edit last --name kitchen\n", 1, ANY_NUMBER,
     edit_options, edit_run},
    {"rm", "JOB...", "remove jobs that are not running, with their outputs", "",
     "  unbake rm 12 13\n  unbake rm 12 --dry-run\n", 1, ANY_NUMBER, rm_options, rm_run},
    {"scenes", "[show|keep|rm SCENE...|set SCENE KEY=VALUE...]", "list uploaded rooms, show, keep or remove them",
     "A SCENE is an id or its beginning, 8 digits or more. What the server removes by itself, and when,\n"
     "is in the column `expires`. `set` says how a room is to be read, in place of what was said before (without\n"
     "KEY=VALUE: as its files say), and has it checked again; see --scene-set of `submit`.\n",
     "  unbake scenes\n  unbake scenes show 3f2a91c0\n  unbake scenes keep 3f2a91c0 --pin\n"
     "  unbake scenes rm 3f2a91c0 --dry-run\n  unbake scenes set 3f2a91c0 axes=opencv scale=0.001\n",
     0, ANY_NUMBER, collection_options, scenes_run},
    {"uploads", "[show|keep|rm UPLOAD...]", "list uploads, show, keep or remove them",
     "`unbake submit` of the same room continues where an upload stopped. A complete upload becomes\n"
     "a scene.\n",
     "  unbake uploads\n  unbake uploads keep 5f0c77d2a5e14b0e8f6f0c9f4b6f8d11 --keep-days 7\n", 0, ANY_NUMBER,
     collection_options, uploads_run},
    {"collect", "", "remove now what has expired (admins)",
     "The server does so itself, once a minute or as configured.\n", "  unbake collect --dry-run\n", 0, 0,
     collect_options, collect_run},
    {"login", "", "store a server's token for later commands",
     "Reads the token from stdin, asks the server whose it is, and stores it in a file that nobody else\n"
     "can read, ~/.config/unbake/tokens. $UNBAKE_TOKEN overrides it.\n",
     "  unbake login --server https://lab.example.org\n  unbake login <token.txt\n", 0, 0, no_options, login_run},
    {"logout", "", "remove the stored token", "", "  unbake logout\n", 0, 0, no_options, logout_run},
    {"settings", "[NAME...]", "list what --set can set, with ranges and defaults", "",
     "  unbake settings\n  unbake settings texture_size\n  unbake settings --kind render\n", 0, ANY_NUMBER,
     settings_options, settings_run},
    {"servers", "", "list the servers that have names",
     "They are in ~/.config/unbake/config (or $XDG_CONFIG_HOME/unbake/config): `server = NAME` names the one that is\n"
     "taken by default, [NAME] begins a server, with `url`, and where needed `ca` (certificates to trust) and\n"
     "`token_file` (a file with its token, which nobody else may read). * marks the one that is taken.\n",
     "  unbake servers\n  unbake list --server lab\n", 0, 0, servers_options, servers_run},
    {"version", "", "print the versions of the client and of the server", "",
     "  unbake version -v\n  unbake version -o json\n", 0, 0, version_options, version_run},
    {"manual", "PAGE", "write unbake.1, or the completion for bash or zsh", "",
     "  unbake manual unbake.1 | man -l -\n  source <(unbake manual bash)\n", 1, 1, no_options, manual_run},
};

#define COMMAND_COUNT (sizeof table / sizeof *table)

const struct command *command_table(size_t *count) {
    *count = COMMAND_COUNT;
    return table;
}

const struct command *command_find(const char *name) {
    for (size_t i = 0; i < COMMAND_COUNT; i++)
        if (strcmp(table[i].name, name) == 0)
            return &table[i];
    return NULL;
}

bool command_is_local(const struct command *command) {
    return command->run == servers_run || command->run == manual_run;
}

const char *command_option_help(const struct command_option *option) {
    return render_settings_find(option->name, NULL)->help;
}

const struct command_exit command_exit_statuses[] = {
    {CLIENT_OK, "success"},
    {CLIENT_JOB_FAILED, "the job failed or was cancelled"},
    {CLIENT_USAGE, "the command line is wrong"},
    {CLIENT_NOT_FOUND, "no such job, scene or output"},
    {CLIENT_REFUSED, "the server refused, and said why"},
    {CLIENT_UNREACHABLE, "the server cannot be reached"},
    {CLIENT_CONFLICT, "the current state does not allow it"},
    {CLIENT_LOCAL, "a file here cannot be read or written"},
    {CLIENT_JOB_CANCELLED, "wait: a job was cancelled, none failed"},
    {CLIENT_TIME_OVER, "wait: the jobs had not ended in time"},
    {CLIENT_INTERRUPTED, "interrupted; a submitted job continues"},
    {0, NULL},
};

const char *const command_job_states[] = {JOB_STATE_QUEUED,
                                          JOB_STATE_RUNNING,
                                          JOB_STATE_PAUSED,
                                          JOB_STATE_SUCCEEDED,
                                          JOB_STATE_FAILED,
                                          JOB_STATE_CANCELLED,
                                          NULL};

const char *const command_job_kinds[] = {JOB_KIND_RECONSTRUCT, JOB_KIND_RENDER, JOB_KIND_EVALUATE, NULL};

static void print_exit_statuses(FILE *out) {
    fputs("exit status:\n", out);
    for (size_t i = 0; command_exit_statuses[i].meaning; i++)
        fprintf(out, "  %-4d %s\n", command_exit_statuses[i].status, command_exit_statuses[i].meaning);
}

void command_help(const struct command *command, FILE *out) {
    if (command) {
        fprintf(out, "usage: unbake %s%s%s [options]\n\n%s.\n", command->name, *command->arguments ? " " : "",
                command->arguments, command->summary);
        if (*command->details)
            fprintf(out, "\n%s", command->details);
        fprintf(out, "\nexamples:\n%s\noptions:\n", command->examples);
        options_print(command->options, command_option_help, out);
        options_print(command_shared_options, command_option_help, out);
        return;
    }
    fputs("unbake takes the light out of a scanned room; `unbaked` does the work.\n\n"
          "usage: unbake COMMAND [options]\n\ncommands:\n",
          out);
    for (size_t i = 0; i < COMMAND_COUNT; i++)
        fprintf(out, "  %-9s %s\n", table[i].name, table[i].summary);
    fputs("\nA JOB is a number, or `last` for the newest. `unbake COMMAND --help` has the options and\n"
          "an example of each command. Every command takes:\n",
          out);
    options_print(command_shared_options, command_option_help, out);
    fputs("\n", out);
    print_exit_statuses(out);
}
