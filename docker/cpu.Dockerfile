# gsac on the processor: `docker compose run cpu` runs the clips of ./clips.
FROM python:3.11-slim-bookworm
ENV GSAC_CACHE=/cache GSAC_COPY=1 PIP_NO_CACHE_DIR=1 PYTHONUNBUFFERED=1
RUN pip install torch==2.13.0 --index-url https://download.pytorch.org/whl/cpu
COPY . /src
RUN pip install /src && rm -rf /src && gsac models pull
VOLUME /cache
ENTRYPOINT ["gsac"]
CMD ["batch", "/clips", "--out", "/avatars"]
