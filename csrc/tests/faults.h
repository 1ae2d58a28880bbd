/* Allocations that fail on demand; linked with --wrap=malloc,calloc,realloc. */
#ifndef GR_TESTS_FAULTS_H
#define GR_TESTS_FAULTS_H

/* The n-th allocation from now on fails (n = 1 is the next one), and only that; n = 0: none fails. */
void faults_at(long n);
/* Whether it has been reached. */
int faults_hit(void);
/* Allocations since then. */
long faults_calls(void);

#endif
