/* What the kernels use of string.h, for a GPU: the compiler has these. */
#pragma once

#define memcpy __builtin_memcpy
#define memmove __builtin_memmove
#define memset __builtin_memset

int strcmp(const char *a, const char *b); /* of functions that no thread calls */
