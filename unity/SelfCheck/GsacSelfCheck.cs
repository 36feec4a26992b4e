using System;
using System.Collections;
using System.Collections.Generic;
using UnityEngine;
using UnityEngine.Rendering;
using UnityEngine.XR;

namespace Gsac
{
    /// <summary>
    /// Compares Unity's pictures of a person with those that the file asks for, and writes the result as JSON. In a scene it does so once,
    /// in players and headsets too; the menu GSAC > Self-check does so in each render pipeline of the project.
    /// </summary>
    [AddComponentMenu("Gsac/Gsac Self Check")]
    public sealed class GsacSelfCheck : MonoBehaviour
    {
        const int Size = 256;
        const int Settling = 30; // frames
        const int Layer = 31;
        static readonly Color Behind = new Color(0.1f, 0.6f, 0.2f, 1); // what few people wear

        [SerializeField, Tooltip("Who is looked at: the first.")] GsacCast cast = null;
        [SerializeField, Tooltip("What the headset shows; alone with the person, before one colour.")] Camera eye = null;

        /// <summary>Null until the end.</summary>
        public string ResultFile { get; private set; }

        IEnumerator Start()
        {
            GsacAvatar avatar = cast == null ? null : cast.First;
            if (avatar == null) yield break; // the cast has said it
            for (int i = 0; i < Settling; i++) yield return null;
            List<GsacCheckedView> views = Look(avatar);
            if (eye != null && eye.stereoEnabled)
            {
                Pose(avatar);
                yield return null;
                yield return new WaitForEndOfFrame();
                LookByEyes(avatar, views);
            }
            ResultFile = Write(avatar, PipelineName(GraphicsSettings.currentRenderPipeline), views);
        }

        public static string PipelineName(RenderPipelineAsset pipeline)
        {
            if (pipeline == null) return "built-in";
            string type = pipeline.GetType().Name;
            return type.StartsWith("Universal", StringComparison.Ordinal) ? "URP" : type.StartsWith("HD", StringComparison.Ordinal) ? "HDRP" : type;
        }

        /// <summary>Renders the person by hand, with perspective, from the side, and without perspective.</summary>
        public static List<GsacCheckedView> Look(GsacAvatar avatar)
        {
            int layer = avatar.gameObject.layer;
            avatar.gameObject.layer = Layer;
            Pose(avatar);
            var camera = new GameObject("GSAC self-check").AddComponent<Camera>();
            var target = new RenderTexture(Size, Size, 24);
            try
            {
                camera.enabled = false;
                camera.cullingMask = 1 << Layer;
                camera.clearFlags = CameraClearFlags.SolidColor;
                camera.backgroundColor = Behind;
                camera.allowHDR = camera.allowMSAA = false;
                camera.nearClipPlane = 0.1f;
                camera.farClipPlane = 20;
                camera.fieldOfView = 40;
                camera.orthographicSize = 1.1f;
                camera.targetTexture = target;
                var views = new List<GsacCheckedView>();
                views.Add(View("front", avatar, camera, target, 0));
                views.Add(View("turned", avatar, camera, target, 70));
                camera.orthographic = true;
                views.Add(View("orthographic", avatar, camera, target, 30));
                return views;
            }
            finally
            {
                avatar.gameObject.layer = layer;
                camera.targetTexture = null;
                Free(camera.gameObject);
                Free(target);
            }
        }

        static GsacCheckedView View(string name, GsacAvatar avatar, Camera camera, RenderTexture target, float yaw)
        {
            Quaternion turn = Quaternion.Euler(5, yaw + 180, 0);
            camera.transform.SetPositionAndRotation(avatar.transform.position + new Vector3(0, 0.9f, 0) - turn * Vector3.forward * 3.2f, turn);
            camera.Render();
            RenderTexture before = RenderTexture.active;
            RenderTexture.active = target;
            var got = new Texture2D(Size, Size);
            got.ReadPixels(new Rect(0, 0, Size, Size), 0, 0);
            RenderTexture.active = before;
            Color32[] pixels = got.GetPixels32();
            Free(got);
            return Row(name, "mono", avatar, pixels, Size, 0, Size, Size, camera.worldToCameraMatrix, camera.projectionMatrix, Behind);
        }

        /// <summary>What each eye of the headset was shown in the frame that has ended.</summary>
        void LookByEyes(GsacAvatar avatar, List<GsacCheckedView> views)
        {
            Texture2D both = ScreenCapture.CaptureScreenshotAsTexture(ScreenCapture.StereoScreenCaptureMode.BothEyes);
            Color32[] pixels = both.GetPixels32();
            int width = both.width / 2;
            foreach (Camera.StereoscopicEye side in new[] { Camera.StereoscopicEye.Left, Camera.StereoscopicEye.Right })
            {
                views.Add(Row(side.ToString().ToLowerInvariant() + " eye", XRSettings.stereoRenderingMode.ToString(), avatar, pixels, both.width,
                              (int)side * width, width, both.height, eye.GetStereoViewMatrix(side), eye.GetStereoProjectionMatrix(side), eye.backgroundColor));
            }
            Free(both);
        }

        static void Pose(GsacAvatar avatar)
        {
            avatar.APose();
            avatar.SkipFade();
            avatar.ClearExpressions();
            if (Array.IndexOf(avatar.Data.Expressions, "jawOpen") >= 0) avatar.SetExpression("jawOpen", 0.5f);
            avatar.Refresh(0);
            avatar.GetComponent<GsacRenderer>().Refresh();
        }

        /// <summary>pixels: lowest row first; the view begins at column `left` of rows of `stride`.</summary>
        static GsacCheckedView Row(string name, string mode, GsacAvatar avatar, Color32[] pixels, int stride, int left, int width, int height,
                              Matrix4x4 view, Matrix4x4 projection, Color behind)
        {
            var bones = new Vector4[avatar.Data.JointCount * 3];
            GsacSkeleton.Bones(avatar.Data, avatar.transform, avatar.Joints, bones);
            avatar.CollectWeights();
            float[] want = GsacPainter.Paint(avatar.Data, bones, avatar.DrawnWeights, view * avatar.transform.localToWorldMatrix, projection, width, height);
            double squares = 0, counted = 0, there = 0, seen = 0;
            for (int j = 0; j < height; j++)
            {
                for (int i = 0; i < width; i++)
                {
                    Color32 got = pixels[(height - 1 - j) * stride + left + i];
                    int at = (j * width + i) * 4;
                    float through = 1 - want[at + 3];
                    double red = want[at] + through * behind.r - got.r / 255.0, green = want[at + 1] + through * behind.g - got.g / 255.0;
                    double blue = want[at + 2] + through * behind.b - got.b / 255.0;
                    bool drawn = Math.Abs(got.r / 255.0 - behind.r) + Math.Abs(got.g / 255.0 - behind.g) + Math.Abs(got.b / 255.0 - behind.b) > 0.05;
                    if (want[at + 3] > 0.5f) there++;
                    if (drawn) seen++;
                    if (want[at + 3] == 0 && !drawn) continue;
                    squares += red * red + green * green + blue * blue;
                    counted += 3;
                }
            }
            return new GsacCheckedView
            {
                Name = name, Mode = mode, Decibels = Math.Min(99, -10 * Math.Log10(squares / Math.Max(counted, 1))),
                PersonShare = there / (width * height), DrawnShare = seen / (width * height),
            };
        }

        /// <summary>The path of the file.</summary>
        public static string Write(GsacAvatar avatar, string pipeline, List<GsacCheckedView> views)
        {
            GsacReport report = GsacReport.OfDevice("self-check");
            report.Add("pipeline", pipeline);
            report.Add("colours", QualitySettings.activeColorSpace.ToString());
            var animator = avatar.GetComponent<Animator>();
            report.Add("humanoid", animator != null && animator.avatar != null && animator.avatar.isValid && animator.avatar.isHuman);
            report.Add("joints", avatar.Joints.Length);
            report.Add("expressions", avatar.Data.Expressions.Length);
            report.Add("gaussians", avatar.Data.Levels[0].Count);
            report.Add("views", views.ConvertAll(view => view.Report()));
            return report.Write("gsac-self-check-" + pipeline);
        }

        static void Free(UnityEngine.Object made)
        {
            if (Application.isPlaying) Destroy(made);
            else DestroyImmediate(made);
        }
    }
}
