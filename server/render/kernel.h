/* kernel.h -- functions that are compiled for several instruction sets, of which the processor's is taken at start.
 *
 * -ffp-contract=off makes each the same arithmetic: they differ in how many lanes they take at once, never in a
 * result. */
#ifndef UNBAKE_RENDER_KERNEL_H
#define UNBAKE_RENDER_KERNEL_H

/* Sanitizers do not support the ifunc resolver of target_clones. */
#if defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define KERNEL __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define KERNEL
#endif

#endif
