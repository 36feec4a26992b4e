# gsac on an NVIDIA GPU: torch's wheels bring the CUDA libraries, the host its driver and container toolkit. EXTRAS: of the package.
FROM python:3.11-slim-bookworm@sha256:a36c24f9cbdf4fd0f52d67f0823eeac19c2028c637cecc392d97f980d4fec56b
ARG EXTRAS="[gpu,s3]"
ENV GSAC_CACHE=/cache GSAC_COPY=1 PIP_NO_CACHE_DIR=1 PYTHONUNBUFFERED=1
ENV NVIDIA_VISIBLE_DEVICES=all NVIDIA_DRIVER_CAPABILITIES=compute,utility
RUN pip install torch==2.13.0
COPY . /src
RUN pip install "/src${EXTRAS}" && rm -rf /src && gsac models pull && useradd --create-home gsac && mkdir /avatars \
    && chown -R gsac /cache /avatars
USER gsac
VOLUME /cache
ENTRYPOINT ["gsac"]
CMD ["batch", "/clips", "--out", "/avatars"]
