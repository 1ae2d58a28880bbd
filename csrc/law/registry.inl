/* The registry: one line for each law. kernels.c includes it twice, first for the laws and then, with GR_LIST_LAWS, for
 * the list of them. Kernels in single precision have the first of them. */
#include "law/elastic.inl"
#include "law/drucker_prager.inl"
#include "law/mu_I.inl"
#include "law/ngf.inl"
#include "law/regularised_mu_I.inl"
#ifndef GR_SINGLE
#include "law/own.inl"
#include "law/dilatant_mu_I.inl"
#include "law/hencky_elastic.inl"
#include "law/hencky_drucker_prager.inl"
#include "law/hencky_hardening_drucker_prager.inl"
#include "law/hencky_mu_I.inl"
#include "law/hencky_linear_mu_I.inl"
#include "law/hencky_ngf.inl"
#include "law/hencky_linear_ngf.inl"
#endif
