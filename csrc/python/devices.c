/* Devices of engines, and the GPU of the machine; what is here is said in engine_common.h. */
#include <string.h>

#include "gpu/driver.h"
#include "kernels.h"
#include "mpm/device.h"
#include "python/engine_common.h"

int gr_find_device(struct gr_object *self, const char *name)
{
    static const struct gr_backend *const known[] = {&gr_emulated, &gr_gpu};
    self->device = NULL;
    for (int k = 0; k < 2; k++)
        if (!strcmp(name, known[k]->name)) self->device = known[k];
    if (*name && !self->device) return gr_refuse("there is no device \"%s\"", name);
    if (self->device == &gr_gpu && !gr_gpu_info().total) return gr_refuse("the GPU is not open");
    return 0;
}

int gr_take_device(struct gr_object *self)
{
    struct gr_engine *e = self->engine;
    if (!self->device) return 0;
    const char *const lacking = gr_device_lacks(&e->config);
    if (lacking) return gr_refuse("device = '%s' does not have %s", self->device->name, lacking);
    const int error = gr_device_new(&e->device, self->device, gr_in_precision(self->kernels, e->config.single)->threads);
    if (error) gr_raise(error, NULL);
    return error ? -1 : 0;
}

void gr_use_memory(const struct gr_object *self) { gr_use_source(self->device ? &self->device->memory : NULL); }

PyObject *gr_python_foreign_array(struct gr_object *self, PyObject *Py_UNUSED(unused))
{
    const struct gr_engine *e = gr_ready(self, 1);
    if (e && e->device) return Py_BuildValue("z", gr_foreign_array(e));
    return e ? PyErr_Format(PyExc_ValueError, "the engine has no device") : NULL;
}

PyObject *gr_python_open_gpu(PyObject *Py_UNUSED(module), PyObject *args)
{
    const char *text[2], *refusal;
    Py_ssize_t length[2];
    if (!PyArg_ParseTuple(args, "y#y#", &text[0], &length[0], &text[1], &length[1])) return NULL;
    const size_t size[2] = {(size_t)length[0] + 1, (size_t)length[1] + 1}; /* with the zero behind the bytes */
    Py_BEGIN_ALLOW_THREADS
    refusal = gr_open_gpu(text, size);
    Py_END_ALLOW_THREADS
    if (refusal) return PyErr_Format(PyExc_RuntimeError, "%s", refusal);
    const struct gr_gpu_info info = gr_gpu_info();
    return Py_BuildValue("{s:s,s:K,s:K}", "name", info.name, "free", (unsigned long long)info.free, "total",
                         (unsigned long long)info.total);
}
