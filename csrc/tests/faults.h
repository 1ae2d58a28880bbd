/* Allocations that fail on demand; linked with --wrap=malloc,calloc,realloc. */
#pragma once

/* Let the n-th allocation from now on fail (n = 1 is the next one), and only that one; with n = 0 none fails. */
void faults_at(long n);
/* No more failures. Returned: whether that allocation was reached. */
int faults_end(void);
/* Number of allocations since then. */
long faults_calls(void);

/* Let the system give n more threads and refuse all others; -1 ends it. */
void faults_allow_threads(int n);
