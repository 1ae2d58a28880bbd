/* The registry: one line for each law, or family of laws in one file. kernels.c includes it twice, first for the laws and
 * then, with GR_LIST_LAWS, for the list of them. */
#include "law/elastic.inl"
#include "law/drucker_prager.inl"
#include "law/mu_I.inl"
#include "law/ngf.inl"
#include "law/hencky_laws.inl"
