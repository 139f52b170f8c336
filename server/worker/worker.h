/* worker.h -- the child process: one attempt of one job, or one check of one scene.
 *
 *   unbaked worker DIR
 *
 * 1. DIR holds job.json, which says what to do; its flock belongs to the worker while it lives,
 *    so two workers never work in one folder.
 * 2. It writes only below DIR and reads only the scene besides (sandbox.h); what it has to say
 *    goes down the pipe at PROGRESS_FD (progress.h), what it has to complain about to stderr.
 * 3. It dies with the daemon (PR_SET_PDEATHSIG, set by server/job/process.c): the next daemon starts
 *    the next attempt, which goes on from the checkpoint. */
#ifndef UNBAKE_WORKER_WORKER_H
#define UNBAKE_WORKER_WORKER_H

/* The entry of `unbaked worker DIR`; argv[0] is "worker". Returns an enum progress_exit. */
int worker_main(int argc, char **argv);

#endif
