// Not Unity's: plays the part of its main loop for the tests.
using System;
using System.Collections.Generic;
using System.Reflection;

namespace UnityEngine
{
    public static class Player
    {
        /// <summary>What is called at each dispatch (shader, kernel, groups) and draw (parameters, indices, how many).</summary>
        public static Action<ComputeShader, int, int> OnDispatch;
        public static Action<RenderParams, GraphicsBuffer, int> OnDraw;
        public static Action OnUpload;
        public static Action<Camera> OnRender;
        public static Func<Texture2D> OnCapture;

        /// <summary>What is called where splats are drawn into an avatar's own picture (properties, indices); whether a device can.</summary>
        public static Action<MaterialPropertyBlock, int> OnOwnDraw;
        public static bool HasHalfTargets;

        /// <summary>Of the last such draw.</summary>
        public static Rect OwnViewport;

        /// <summary>The light around, and whose colliders stand between the person and the sun.</summary>
        public static Rendering.SphericalHarmonicsL2 Probe;
        public static readonly List<Transform> BeforeSun = new List<Transform>();

        /// <summary>What the user does: the button pressed, controls by label and where they are put.</summary>
        public static string Pressed;
        public static string Typed;
        public static int UpdatesAsked;
        public static int FilesRead;
        public static int HandlesSeen;
        public static readonly Dictionary<int, Vector3> Drags = new Dictionary<int, Vector3>();
        public static int Heads; // for the made-up human poses: their turns come with either sign

        /// <summary>The objects that an inspector shows at once; null: its own target.</summary>
        public static Object[] Chosen;
        public static readonly List<string> Labels = new List<string>();
        public static readonly Dictionary<string, float> Slides = new Dictionary<string, float>();

        public static void Mouse(EventType type, float x, float deltaX, float deltaY)
        {
            Event.current = new Event { type = type, mousePosition = new Vector2 { x = x }, delta = new Vector2 { x = deltaX, y = deltaY } };
        }

        public static void Call(Component on, string message)
        {
            MethodInfo method = Method(on, message);
            if (method != null) method.Invoke(on, null);
        }

        static MethodInfo Method(Component on, string message)
        {
            return on.GetType().GetMethod(message, BindingFlags.Instance | BindingFlags.NonPublic | BindingFlags.Public, null, Type.EmptyTypes, null);
        }

        /// <summary>Whether cameras are rendered by a scriptable pipeline.</summary>
        public static bool HasPipeline;

        /// <summary>A frame of these components as one call, in their execution order, and then of all cameras.</summary>
        public static Action Frame(GameObject[] objects)
        {
            Action all = () => Time.frameCount++;
            foreach (string message in new[] { "Update", "LateUpdate" })
            {
                var ordered = new List<KeyValuePair<int, Action>>();
                foreach (GameObject o in objects)
                {
                    foreach (Component c in o.Components)
                    {
                        MethodInfo method = Method(c, message);
                        if (method == null) continue;
                        var order = (DefaultExecutionOrder)Attribute.GetCustomAttribute(c.GetType(), typeof(DefaultExecutionOrder));
                        ordered.Add(new KeyValuePair<int, Action>(order == null ? 0 : order.order, (Action)Delegate.CreateDelegate(typeof(Action), c, method)));
                    }
                }
                ordered.Sort((a, b) => a.Key.CompareTo(b.Key));
                foreach (KeyValuePair<int, Action> pair in ordered) all += pair.Value;
            }
            return all + RenderCameras;
        }

        static void RenderCameras()
        {
            for (int i = 0; i < Camera.All.Count; i++) if (Camera.All[i].enabled) Camera.All[i].Render();
        }

        /// <summary>What brings back an object's saved state: a transform's place and turn, blend shapes, serialized fields.</summary>
        public static Action Restore(Object of)
        {
            Action all = () => { };
            var transform = of as Transform;
            if (transform != null)
            {
                Vector3 place = transform.localPosition;
                Quaternion turn = transform.localRotation;
                return () =>
                {
                    transform.localPosition = place;
                    transform.localRotation = turn;
                };
            }
            var body = of as SkinnedMeshRenderer;
            if (body != null)
            {
                var weights = new Dictionary<int, float>(body.Weights);
                return () =>
                {
                    body.Weights.Clear();
                    foreach (KeyValuePair<int, float> pair in weights) body.Weights.Add(pair.Key, pair.Value);
                };
            }
            foreach (FieldInfo field in of.GetType().GetFields(BindingFlags.Instance | BindingFlags.NonPublic | BindingFlags.Public))
            {
                if (!field.IsPublic && !Attribute.IsDefined(field, typeof(SerializeField))) continue;
                object value = field.GetValue(of);
                all += () => field.SetValue(of, value);
            }
            return all;
        }

        public static Dictionary<string, AnimationCurve> Curves(AnimationClip clip) { return clip.Curves; }
        public static Vector3[] Shape(Mesh mesh, int index) { return mesh.Shapes[index].Value; }
        public static string PropertyName(int id) { return Shader.NameOf(id); }
        public static string KernelName(int kernel) { return ComputeShader.Kernels[kernel]; }
        public static uint[] Words(GraphicsBuffer buffer) { return buffer.Words; }
        public static Vector4 Value(ComputeShader shader, int id) { return shader.Values[id]; }
        public static GraphicsBuffer Buffer(ComputeShader shader, int kernel, int id) { return shader.Buffers[kernel, id]; }
        public static Vector4 Value(MaterialPropertyBlock block, int id) { return block.Values[id]; }
        public static GraphicsBuffer Buffer(MaterialPropertyBlock block, int id) { return block.Buffers[id]; }
        public static Vector4[] Values(MaterialPropertyBlock block, int id) { return block.Arrays[id]; }
        public static Matrix4x4 Matrix(MaterialPropertyBlock block, int id) { return block.Matrices[id]; }
        public static Texture Texture(MaterialPropertyBlock block, int id) { return block.Textures[id]; }
        public static int BuffersAlive { get { return GraphicsBuffer.Alive; } }
        public static int Alive<T>() { return UnityEngine.Object.Made.FindAll(o => o is T && o != null).Count; }
        public static List<string> Errors { get { return Debug.Errors; } }
        public static HumanDescription Description(Avatar avatar) { return avatar.Description; }
        public static void SetDeltaTime(float seconds) { Time.deltaTime = seconds; }
        public static void SetPipeline(Rendering.RenderPipeline pipeline) { Rendering.RenderPipelineManager.currentPipeline = pipeline; }
        public static void SetDataPath(string folder) { Application.persistentDataPath = folder; }
        public static void SetPlaying(bool playing) { Application.isPlaying = playing; }
        public static void SetComputeShaders(bool there) { SystemInfo.supportsComputeShaders = there; }
        public static Camera AddCamera(string name)
        {
            var camera = new GameObject(name).AddComponent<Camera>();
            Camera.All.Add(camera);
            return camera;
        }
        public static void SetRect(Camera camera, float width, float height) { camera.rect = new Rect(0, 0, width, height); }
        public static void SetPixelHeight(Camera camera, int height) { camera.pixelHeight = XR.XRSettings.eyeTextureHeight = height; }
        public static void SetEyes(Camera camera, float[] focal) { camera.EyeFocal = focal; }
        public static void SetField(Component on, string field, object value)
        {
            on.GetType().GetField(field, BindingFlags.Instance | BindingFlags.NonPublic).SetValue(on, value);
        }
        public static T Last<T>() where T : Component
        {
            return (T)GameObject.Made.FindLast(c => c is T);
        }
        public static void BeforeRender() { Application.BeforeRender(); }
        public static object Field(Component of, string field)
        {
            return of.GetType().GetField(field, BindingFlags.Instance | BindingFlags.NonPublic).GetValue(of);
        }
        public static TextAsset Text(byte[] bytes) { return new TextAsset { Bytes = bytes }; }
    }
}
