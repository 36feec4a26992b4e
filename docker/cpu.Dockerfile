# gsac on the processor: `docker compose run cpu` runs the clips of ./clips. EXTRAS: of the package, such as [ray,s3].
FROM python:3.11-slim-bookworm@sha256:a36c24f9cbdf4fd0f52d67f0823eeac19c2028c637cecc392d97f980d4fec56b
ARG EXTRAS="[s3]"
ENV GSAC_CACHE=/cache GSAC_COPY=1 PIP_NO_CACHE_DIR=1 PYTHONUNBUFFERED=1
RUN pip install torch==2.13.0 --index-url https://download.pytorch.org/whl/cpu
COPY . /src
RUN pip install "/src${EXTRAS}" && rm -rf /src && gsac models pull && useradd --create-home gsac && mkdir /avatars \
    && chown -R gsac /cache /avatars
USER gsac
VOLUME /cache
ENTRYPOINT ["gsac"]
CMD ["batch", "/clips", "--out", "/avatars"]
